//! Files that are either complete or absent: write beside, then rename.

use crate::error::DataError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// A name in the same folder as `path` that no other call of this process uses.
pub(crate) fn sibling(path: &Path) -> PathBuf {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let count = COUNTER.fetch_add(1, Ordering::Relaxed);
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!(".{name}.{}-{count}.part", std::process::id()))
}

/// Writes a file through `fill` into a temporary sibling and renames it to `path` at the end.
///
/// An existing file at `path` is replaced in one step; on any error it stays as it was and the
/// temporary file is removed.
///
/// # Errors
/// [`DataError::Io`] naming `path`, when `fill` fails or the file cannot be created, flushed or renamed.
pub fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), DataError> {
    let part = sibling(path);
    let written = File::create(&part).and_then(|file| {
        let mut writer = BufWriter::new(file);
        fill(&mut writer)?;
        writer.flush()
    });
    written.and_then(|()| fs::rename(&part, path)).map_err(|source| {
        // The first error is the one to report; a leftover is all that could go wrong here.
        let _ = fs::remove_file(&part);
        DataError::Io { action: "write", path: path.to_path_buf(), source }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_rest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_atomically(&path, |out| out.write_all(b"old")).unwrap();
        let failed = write_atomically(&path, |out| {
            out.write_all(b"ne")?;
            Err(io::Error::other("disk on fire"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk on fire"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
