//! Tells the program which commit it is built from.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    // Where it runs, not where it was compiled: checkouts may share a target folder.
    let folder = &std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from).unwrap_or_default();
    println!("cargo::rustc-env=LIGHT4GS_COMMIT={}", commit(folder).unwrap_or_else(|| "unknown".to_owned()));
    for name in ["src", "configs", "build.rs"] {
        println!("cargo::rerun-if-changed={name}");
    }
    // Every commit, checkout and merge adds a line here.
    if let Some(log) = git(folder, &["rev-parse", "--git-path", "logs/HEAD"]) {
        let log = folder.join(log);
        if log.exists() {
            println!("cargo::rerun-if-changed={}", log.display());
        }
    }
}

/// The commit of our own repository: a copy of the crate may lie in another one.
fn commit(folder: &Path) -> Option<String> {
    let root = git(folder, &["rev-parse", "--show-toplevel"])?;
    if folder.parent()?.canonicalize().ok()? != Path::new(&root).canonicalize().ok()? {
        return None;
    }
    git(folder, &["describe", "--always", "--abbrev=40", "--dirty", "--exclude=*"])
}

/// What git prints; none where it fails, or is not there.
fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").current_dir(folder).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}
