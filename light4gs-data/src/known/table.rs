//! Names of files and their hashes, in a form that is short to keep.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Hexadecimal digits of a hash.
pub(super) const DIGITS: usize = 8;

/// Hashes by patterns of names. `train/r_###.png` stands for numbers from 0 on, of three digits or more, and has the
/// hashes of all these files in one string; a pattern without `#` is one file. A number that is missing has dashes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct FileTable(BTreeMap<String, String>);

impl FileTable {
    /// Each file with its hash.
    pub(super) fn expanded(&self) -> BTreeMap<String, String> {
        let mut files = BTreeMap::new();
        for (pattern, hashes) in &self.0 {
            let digits = pattern.matches('#').count();
            for (number, hash) in hashes.as_bytes().chunks(DIGITS).enumerate() {
                let file = if digits == 0 {
                    pattern.clone()
                } else {
                    pattern.replace(&"#".repeat(digits), &format!("{number:0digits$}"))
                };
                if hash.first() != Some(&b'-') {
                    files.insert(file, String::from_utf8_lossy(hash).into_owned());
                }
            }
        }
        files
    }

    /// The files that a folder has, with their hashes. Names that begin with a dot are left out.
    #[cfg(test)]
    pub(super) fn of(folder: &std::path::Path) -> Result<Self, crate::error::DataError> {
        // Before and behind the number: the numbers as text, and their hashes.
        let mut groups: BTreeMap<(String, String), BTreeMap<String, String>> = BTreeMap::new();
        for file in files_below(folder, "") {
            let hash = crate::digest::Content::of(&folder.join(&file))?.short();
            let (before, number, behind) = around_number(&file);
            groups.entry((before, behind)).or_default().insert(number, hash);
        }
        Ok(Self(groups.into_iter().map(|((before, behind), hashes)| group(&before, &behind, &hashes)).collect()))
    }
}

/// A pattern and its hashes.
#[cfg(test)]
fn group(before: &str, behind: &str, hashes: &BTreeMap<String, String>) -> (String, String) {
    let digits = hashes.keys().map(String::len).min().unwrap_or_default();
    if digits == 0 {
        return (format!("{before}{behind}"), hashes.values().cloned().collect());
    }
    let by_number: BTreeMap<usize, &String> =
        hashes.iter().map(|(number, hash)| (number.parse().expect("digits"), hash)).collect();
    let last = by_number.keys().next_back().copied().unwrap_or_default();
    let none = "-".repeat(DIGITS);
    let joined = (0..=last).map(|number| by_number.get(&number).copied().unwrap_or(&none).as_str()).collect();
    (format!("{before}{}{behind}", "#".repeat(digits)), joined)
}

/// `train/r_012.png` as `train/r_`, `012` and `.png`; without a number, the whole name, nothing and nothing.
#[cfg(test)]
fn around_number(file: &str) -> (String, String, String) {
    let parts = file.rsplit_once('.').and_then(|(stem, suffix)| {
        let (before, number) = stem.rsplit_once('_')?;
        let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| (format!("{before}_"), number.to_owned(), format!(".{suffix}")))
    });
    parts.unwrap_or_else(|| (file.to_owned(), String::new(), String::new()))
}

/// All files of a folder, relative to it, with `/` between folders.
#[cfg(test)]
fn files_below(folder: &std::path::Path, prefix: &str) -> Vec<String> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if name.starts_with('.') {
            continue;
        }
        let path = format!("{prefix}{name}");
        if entry.path().is_dir() {
            files.extend(files_below(&entry.path(), &format!("{path}/")));
        } else {
            files.push(path);
        }
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_the_files_of_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let files =
            ["transforms_train.json", "train/r_000.png", "train/r_100.png", "val/r_0.png", "val/r_10.png", ".hidden"];
        for (number, file) in files.iter().enumerate() {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, [number as u8]).unwrap();
        }
        let table = FileTable::of(folder.path()).unwrap();
        let patterns: Vec<&str> = table.0.keys().map(String::as_str).collect();
        assert_eq!(patterns, ["train/r_###.png", "transforms_train.json", "val/r_#.png"]);
        let mut expected: Vec<&str> = files[..5].to_vec();
        expected.sort_unstable();
        let expanded = table.expanded();
        assert_eq!(expanded.keys().collect::<Vec<_>>(), expected);
        assert_eq!(expanded["transforms_train.json"], "22fc4ecd");
    }
}
