//! Files whose names differ from the wanted ones in case, or in how Unicode composes a letter. Programs of macOS write
//! `é` as two characters, others as one.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use unicode_normalization::UnicodeNormalization;

/// Longer paths exist on no system.
const LONGEST: usize = 4096;

/// The entries of folders by folded name. Each folder is listed once.
#[derive(Default)]
pub(in crate::layouts) struct Names {
    folders: HashMap<PathBuf, HashMap<String, PathBuf>>,
}

impl Names {
    /// The file or folder of this path, or the one whose path differs only in case or in the form of Unicode.
    pub(in crate::layouts) fn find(&mut self, path: &Path) -> Option<PathBuf> {
        if path.as_os_str().len() > LONGEST {
            return None;
        }
        if path.exists() {
            return Some(path.to_path_buf());
        }
        let (parent, name) = (path.parent()?, path.file_name()?);
        let folder = self.find(parent)?;
        let entries = self.folders.entry(folder).or_insert_with_key(|folder| list(folder));
        entries.get(&folded(name)).cloned()
    }
}

fn list(folder: &Path) -> HashMap<String, PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return HashMap::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    // If several names are the same when folded, the first is taken, whatever the order on the disk.
    paths.sort();
    let mut found = HashMap::new();
    for path in paths {
        if let Some(name) = path.file_name() {
            found.entry(folded(name)).or_insert(path.clone());
        }
    }
    found
}

fn folded(name: &OsStr) -> String {
    name.to_string_lossy().nfc().collect::<String>().to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn case_and_form_of_unicode_do_not_matter() {
        let folder = tempfile::tempdir().unwrap();
        let there = folder.path().join("Sparse/Zoe\u{308}");
        std::fs::create_dir_all(&there).unwrap();
        std::fs::write(there.join("Cameras.TXT"), "").unwrap();
        let mut names = Names::default();
        let mut find = |name: &str| names.find(&folder.path().join(name));
        assert_eq!(find("sparse/zo\u{eb}/cameras.txt"), Some(there.join("Cameras.TXT")));
        assert_eq!(find("Sparse/Zoe\u{308}/Cameras.TXT"), Some(there.join("Cameras.TXT")));
        assert_eq!(find("sparse/zoe/cameras.txt"), None);
        assert_eq!(find(&"a/".repeat(100_000)), None);
    }
}
