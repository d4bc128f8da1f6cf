//! A program without the GPU's back end hands over to one that has it.
//!
//! A static program runs on every Linux, but cannot load a graphics driver: that takes the system's own C library. So the
//! archive for Linux has a second program, `light4gs-gpu`, which is linked with that library and looks for Vulkan when it runs.
//! The static one lets it do the work where it starts, and works by itself, on the processor, where it does not.

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The program beside this one that has the GPU's back end.
const WITH_GPU: &str = "light4gs-gpu";

/// Becomes `light4gs-gpu`, if this program lacks the GPU's back end, and this system can start the `light4gs-gpu` beside it, of the
/// same version. Else it returns.
pub fn to_program_with_gpu() {
    if cfg!(feature = "wgpu") {
        return;
    }
    let Some(program) = std::env::current_exe().ok().and_then(|this| beside(&this)) else { return };
    if is_of_this_version(Command::new(&program)) {
        // Under our name, for its messages. Returns only if it cannot be started.
        let name = std::env::args_os().next().unwrap_or_else(|| program.clone().into());
        let _ = Command::new(program).arg0(name).args(std::env::args_os().skip(1)).exec();
    }
}

/// The program with the GPU's back end in the folder of this one; `None` if there is none, or if it is this one.
fn beside(this: &Path) -> Option<PathBuf> {
    let program = this.parent()?.join(WITH_GPU);
    (program.is_file() && program != this).then_some(program)
}

/// Whether a program starts and says that it is of our version. One for another C library, or for a newer one, does not start.
fn is_of_this_version(mut program: Command) -> bool {
    let printed = program.arg("--version").stdin(Stdio::null()).stderr(Stdio::null()).output();
    let expected = concat!("light4gs ", env!("CARGO_PKG_VERSION"), "\n");
    printed.is_ok_and(|printed| printed.status.success() && printed.stdout == expected.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_another_program_is_beside() {
        let folder = tempfile::tempdir().unwrap();
        let [this, other] = ["light4gs", WITH_GPU].map(|name| folder.path().join(name));
        assert_eq!(beside(&this), None, "there is none");
        std::fs::write(&other, "").unwrap();
        assert_eq!(beside(&this), Some(other.clone()));
        assert_eq!(beside(&other), None, "it would start itself forever");
    }

    #[test]
    fn only_a_program_that_starts_and_has_our_version_takes_over() {
        let answers = |script: &str| {
            let mut shell = Command::new("sh");
            shell.args(["-c", script]);
            is_of_this_version(shell)
        };
        let ours = concat!("echo light4gs ", env!("CARGO_PKG_VERSION"));
        assert!(answers(ours));
        assert!(!answers("echo light4gs 0.0.1"));
        assert!(!answers(&format!("{ours}; exit 1")));
        // As where the system has another C library, and nothing loads the program.
        assert!(!is_of_this_version(Command::new("/no/such/program")));
    }
}
