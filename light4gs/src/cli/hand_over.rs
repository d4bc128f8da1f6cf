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
    if is_of_this_version(&program) {
        // Returns only if it cannot be started.
        let _ = Command::new(program).args(std::env::args_os().skip(1)).exec();
    }
}

/// The program with the GPU's back end in the folder of this one; `None` if there is none, or if it is this one.
fn beside(this: &Path) -> Option<PathBuf> {
    let program = this.parent()?.join(WITH_GPU);
    (program.is_file() && program != this).then_some(program)
}

/// Whether a program starts and says that it is of our version. One for another C library, or for a newer one, does not start.
fn is_of_this_version(program: &Path) -> bool {
    let printed = Command::new(program).arg("--version").stdin(Stdio::null()).stderr(Stdio::null()).output();
    let expected = concat!("light4gs ", env!("CARGO_PKG_VERSION"), "\n");
    printed.is_ok_and(|printed| printed.status.success() && printed.stdout == expected.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    /// A folder with a `light4gs-gpu` that is this script.
    fn folder_with(script: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join(WITH_GPU);
        fs::write(&program, script).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        folder
    }

    #[test]
    fn only_another_program_is_beside() {
        let folder = folder_with("");
        assert_eq!(beside(&folder.path().join("light4gs")), Some(folder.path().join(WITH_GPU)));
        assert_eq!(beside(&folder.path().join(WITH_GPU)), None, "it would start itself forever");
        assert_eq!(beside(Path::new("/nowhere/light4gs")), None);
    }

    #[test]
    fn only_a_program_that_starts_and_has_our_version_takes_over() {
        let answers = |script: &str| is_of_this_version(&folder_with(script).path().join(WITH_GPU));
        let version = env!("CARGO_PKG_VERSION");
        assert!(answers(&format!("#!/bin/sh\necho light4gs {version}\n")));
        assert!(!answers("#!/bin/sh\necho light4gs 0.0.1\n"));
        assert!(!answers(&format!("#!/bin/sh\necho light4gs {version}\nexit 1\n")));
        // As where the system has another C library: the file is there, and what should load it is not.
        assert!(!answers(&format!("#!/no/such/loader\necho light4gs {version}\n")));
    }
}
