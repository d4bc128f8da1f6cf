//! Running the program in tests.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::time::Duration;
use std::{fs, io};

use tempfile::TempDir;

/// A folder of its own with a tiny synthetic scene in it.
pub struct Workspace {
    folder: TempDir,
    program: PathBuf,
}

/// Overrides that make a run take seconds.
pub const TINY: [&str; 15] = [
    "train.coarse_iterations=12",
    "train.fine_iterations=48",
    "train.checkpoint_interval=9",
    "train.log_interval=4",
    "train.sh_degree_interval=5",
    "train.densify.adaptive.from=4",
    "train.densify.adaptive.until=40",
    "train.densify.adaptive.interval=8",
    "train.densify.adaptive.prune_from=4",
    "train.densify.adaptive.prune_interval=12",
    "train.densify.adaptive.opacity_reset_interval=20",
    "data.initial_points=300",
    "model.hexplane.resolution=[8, 8, 8, 4]",
    "eval.interval=20",
    "compression.context.fit_iterations=4",
];

/// Overrides that turn on everything that compresses, in a tiny run.
pub const TINY_COMPRESSION: [&str; 7] = [
    "compression.rate.lambda=0.05",
    "compression.rate.from=12",
    "compression.rate.attributes=true",
    "compression.rate.planes_until=44",
    "compression.steps.adaptive_from=20",
    "train.prune.fraction=0.2",
    "train.prune.iterations=[42, 45]",
];

impl Workspace {
    /// A copy of a folder in which a tiny run, `run`, has been trained. It is trained once for all tests of a process.
    /// `temporary` is `env!("CARGO_TARGET_TMPDIR")`, where the original stays until a later process removes it because
    /// it is old.
    pub fn trained(program: &str, temporary: &str) -> Self {
        static TRAINED: OnceLock<Workspace> = OnceLock::new();
        let original = TRAINED.get_or_init(|| {
            remove_old(Path::new(temporary), "trained-");
            let folder = tempfile::Builder::new().prefix("trained-").tempdir_in(temporary);
            let workspace = Self::within(folder.expect("a temporary folder"), program);
            assert_success(&workspace.train("run", &[]).output().expect("the program starts"));
            workspace
        });
        let folder = tempfile::tempdir().expect("a temporary folder");
        copy(original.folder.path(), folder.path()).expect("a readable folder");
        Self { folder, program: program.into() }
    }

    /// Makes the folder and the scene. `program` is `env!("CARGO_BIN_EXE_light4gs-under-test")`.
    pub fn new(program: &str) -> Self {
        Self::within(tempfile::tempdir().expect("a temporary folder"), program)
    }

    fn within(folder: TempDir, program: &str) -> Self {
        let workspace = Self { folder, program: program.into() };
        let scene = workspace.path("scene");
        let frames = ["--train-frames", "8", "--test-frames", "3", "--val-frames", "2"];
        let output = workspace.command(["synth", scene.to_str().unwrap(), "--resolution", "32"]).args(frames).output();
        assert_success(&output.expect("the program starts"));
        workspace
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program with arguments, in the folder.
    pub fn command<'a>(&self, arguments: impl IntoIterator<Item = &'a str>) -> Command {
        let mut command = Command::new(&self.program);
        command.current_dir(self.folder.path()).args(arguments);
        command
    }

    /// Runs to the end.
    pub fn run<'a>(&self, arguments: impl IntoIterator<Item = &'a str>) -> Output {
        self.command(arguments).output().expect("the program starts")
    }

    /// `train scene --out RUN`, which takes seconds, with more `--set`.
    pub fn train(&self, run: &str, overrides: &[&str]) -> Command {
        let mut command = self.command(["train", "scene", "--quiet", "--config", "hexplane-dnerf-cpu", "--out", run]);
        for key_value in TINY.iter().chain(overrides) {
            command.args(["--set", key_value]);
        }
        command
    }

    /// Names in the folder or in a folder below it, sorted.
    pub fn names(&self, below: &str) -> Vec<String> {
        names(&self.path(below))
    }
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            fs::create_dir(&target)?;
            copy(&source, &target)?;
        } else {
            fs::copy(&source, &target)?;
        }
    }
    Ok(())
}

/// Removes what earlier processes have left, except what a process may still use.
fn remove_old(folder: &Path, prefix: &str) {
    const OLD: Duration = Duration::from_secs(3600);
    for name in names(folder).into_iter().filter(|name| name.starts_with(prefix)) {
        let path = folder.join(name);
        let changed = fs::metadata(&path).and_then(|metadata| metadata.modified());
        if changed.is_ok_and(|changed| changed.elapsed().is_ok_and(|age| age > OLD)) {
            let _ = fs::remove_dir_all(path);
        }
    }
}

/// Names in a folder, sorted; empty if there is none.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Fails, and prints the program's output.
#[track_caller]
pub fn assert_success(output: &Output) {
    assert!(
        output.status.success(),
        "exit {:?}\nstdout: {}\nstderr: {}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Fails unless the exit code is 2, there was no panic, and stderr contains all the words.
#[track_caller]
pub fn assert_refused(output: &Output, words: &[&str]) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "stderr: {text}");
    assert!(!text.contains("panicked"), "{text}");
    for word in words {
        assert!(text.contains(word), "`{word}` is not in: {text}");
    }
}
