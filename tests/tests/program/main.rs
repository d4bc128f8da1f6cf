//! The program as its users run it: commands, damaged inputs, kills, resumed runs, studies.

mod animated_glb;
mod bench;
mod command_line;
mod hostile_runs;
mod import_ply;
#[cfg(unix)]
mod kills;
mod resume;
mod scene_files;
mod site;
mod studies;
mod take_export;
mod takes;
#[cfg(target_os = "linux")]
mod view;
mod wishes;

/// The program under test: Cargo builds it before these tests.
const PROGRAM: &str = env!("CARGO_BIN_EXE_light4gs-under-test");

/// A folder with a tiny scene and a finished run on it, `run`.
fn trained() -> light4gs_tests::program::Workspace {
    light4gs_tests::program::Workspace::trained(PROGRAM, env!("CARGO_TARGET_TMPDIR"))
}
