//! Numbered files of one folder or archive: a sequence of frames.

use std::fs;
use std::path::Path;

use crate::error::DataError;

/// The least digits of a number.
const DIGITS: usize = 4;

/// A sequence of files such as `0000.ply`, `0001.ply`... Numbers have as many digits as the last one needs, at least four, so that
/// the order of the names is that of the frames.
#[derive(Clone, Copy, Debug)]
pub struct NumberedFiles {
    count: usize,
    suffix: &'static str,
}

impl NumberedFiles {
    /// `count` files with a suffix, such as `ply`.
    pub fn new(count: usize, suffix: &'static str) -> Self {
        Self { count, suffix }
    }

    /// The name of a file, counted from 0.
    pub fn name(&self, number: usize) -> String {
        let digits = self.count.saturating_sub(1).to_string().len().max(DIGITS);
        format!("{number:0digits$}.{}", self.suffix)
    }

    /// Makes the folder if it does not exist, and refuses one with numbered files that this sequence does not replace: they would be
    /// taken for its frames.
    ///
    /// # Errors
    /// [`DataError::Field`] with the first and the last of these files; what the system refuses.
    pub fn open_folder(&self, folder: &Path) -> Result<(), DataError> {
        fs::create_dir_all(folder).map_err(DataError::io("create", folder))?;
        let mut others = Vec::new();
        for entry in fs::read_dir(folder).map_err(DataError::io("read", folder))? {
            let name = entry.map_err(DataError::io("read", folder))?.file_name();
            others.extend(name.to_str().filter(|name| self.is_of_another(name)).map(str::to_owned));
        }
        others.sort_by_key(|name| (name.len(), name.clone()));
        let (Some(first), Some(last)) = (others.first(), others.last()) else { return Ok(()) };
        Err(DataError::Field {
            path: folder.to_owned(),
            field: if first == last { first.clone() } else { format!("{first} to {last}") },
            problem: format!(
                "{} numbered files are no part of the {} that would be written, and would be taken for frames of the same sequence",
                others.len(),
                self.count
            ),
            remedy: "remove them, or name another folder".to_owned(),
        })
    }

    /// Whether a name is that of a numbered file of the same kind, but none of this sequence.
    fn is_of_another(&self, name: &str) -> bool {
        let Some((stem, suffix)) = name.rsplit_once('.') else { return false };
        let numbered = stem.len() >= DIGITS && stem.bytes().all(|byte| byte.is_ascii_digit());
        let own = stem.parse().is_ok_and(|number: usize| number < self.count && self.name(number) == name);
        suffix == self.suffix && numbered && !own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_as_frames_do() {
        for (count, first, last) in
            [(1, "0000.ply", "0000.ply"), (10_000, "0000.ply", "9999.ply"), (10_001, "00000.ply", "10000.ply")]
        {
            let files = NumberedFiles::new(count, "ply");
            assert_eq!((files.name(0).as_str(), files.name(count - 1).as_str()), (first, last));
            assert!((1..count).all(|number| files.name(number - 1) < files.name(number)));
        }
    }

    #[test]
    fn frames_of_another_sequence_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames");
        let files = NumberedFiles::new(3, "ply");
        files.open_folder(&path).unwrap();
        for name in ["0000.ply", "0002.ply", "0003.png", "3.ply", "cloud.ply", "00a0.ply", "0004"] {
            fs::write(path.join(name), "").unwrap();
        }
        files.open_folder(&path).unwrap();
        for number in 3..10 {
            fs::write(path.join(format!("{number:04}.ply")), "").unwrap();
        }
        let problem = files.open_folder(&path).unwrap_err().to_string();
        assert!(
            problem.contains("frames") && problem.contains("0003.ply to 0009.ply") && problem.contains("remove"),
            "{problem}"
        );
        assert!(NumberedFiles::new(10, "ply").open_folder(&path).is_ok());
        // Of a longer sequence, whose numbers have more digits.
        assert!(NumberedFiles::new(10_001, "ply").open_folder(&path).is_err());
        fs::write(path.join("99999999999999999999999.ply"), "").unwrap();
        assert!(NumberedFiles::new(10, "ply").open_folder(&path).is_err());
    }
}
