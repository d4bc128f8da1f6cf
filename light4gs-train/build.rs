//! Tells the library which commit it is built from, and embeds the presets of `configs/`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    // Where it runs, not where it was compiled: checkouts may share a target folder.
    let folder = &std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from).unwrap_or_default();
    println!("cargo::rustc-env=LIGHT4GS_COMMIT={}", commit(folder).unwrap_or_else(|| "unknown".to_owned()));
    write_presets(folder);
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

/// Writes the list of presets: every TOML file of `configs/` and of the folders in it.
fn write_presets(folder: &Path) {
    fn collect(folder: &Path, into: &mut BTreeMap<String, PathBuf>) {
        for entry in fs::read_dir(folder).expect("reading configs").map(|entry| entry.expect("an entry").path()) {
            if entry.is_dir() {
                collect(&entry, into);
            } else if let (Some(stem), Some("toml")) =
                (entry.file_stem(), entry.extension().and_then(|end| end.to_str()))
            {
                let name = stem.to_str().expect("a preset's name is plain text").to_owned();
                if let Some(other) = into.insert(name, entry.clone()) {
                    panic!("two presets have one name: {} and {}", other.display(), entry.display());
                }
            }
        }
    }
    let mut presets = BTreeMap::new();
    collect(&folder.join("configs"), &mut presets);
    let rows = presets.iter().map(|(name, path)| format!("    ({name:?}, include_str!({path:?})),\n"));
    let text = format!("const PRESETS: &[(&str, &str)] = &[\n{}];\n", rows.collect::<String>());
    let out = std::env::var_os("OUT_DIR").map(PathBuf::from).expect("cargo sets OUT_DIR");
    fs::write(out.join("presets.rs"), text).expect("writing the list of presets");
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
