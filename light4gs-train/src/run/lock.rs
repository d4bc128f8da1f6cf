//! Only one process writes into a run folder: it holds a lock, which ends with the process.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use light4gs_data::{DataError, process_id};

use crate::error::TrainError;
use crate::utc;

/// The file that is locked. It is never removed: what counts is its lock, not its existence. Its existence says that
/// the folder is one of ours.
pub(super) const LOCK_FILE: &str = ".light4gs-lock";

/// Held while a process writes into a run folder. The system releases it however the process ends.
#[derive(Clone, Debug)]
pub(super) struct RunLock(#[expect(dead_code, reason = "the open file is what holds the lock")] Arc<File>);

impl RunLock {
    /// Takes the lock of an existing folder.
    ///
    /// # Errors
    /// [`TrainError::RunInUse`] with what the holder has written about itself.
    pub(super) fn take(root: &Path) -> Result<Self, TrainError> {
        let path = root.join(LOCK_FILE);
        let failed = |action| DataError::io(action, &path);
        // A link or a pipe of this name is not ours: following or opening it could change something else, or wait.
        if path.symlink_metadata().is_ok_and(|metadata| !metadata.is_file()) {
            return Err(TrainError::Input(format!("{} is no regular file; remove it", path.display())));
        }
        let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = open.map_err(failed("open"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(in_use(root, &mut file)),
            // Some network file systems have no locks. A run without this protection is better than none.
            Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(failed("lock")(error).into()),
        }
        let holder = format!("process {} since {}\n", process_id(), utc::now());
        let written = file.set_len(0).and_then(|()| file.rewind()).and_then(|()| file.write_all(holder.as_bytes()));
        written.map_err(failed("write"))?;
        Ok(Self(Arc::new(file)))
    }
}

/// The error that names the holder of the lock, as far as the file tells.
fn in_use(root: &Path, file: &mut File) -> TrainError {
    let mut holder = String::new();
    let read = file.take(200).read_to_string(&mut holder);
    let holder = match holder.trim() {
        said if read.is_ok() && !said.is_empty() => said.to_owned(),
        _ => "another process".to_owned(),
    };
    TrainError::RunInUse { root: PathBuf::from(root), holder }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_lock_is_refused_and_names_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let first = RunLock::take(folder.path()).unwrap();
        let text = RunLock::take(folder.path()).unwrap_err().to_string();
        assert!(text.contains(&format!("process {}", std::process::id())), "{text}");
        let copy = first.clone();
        drop(first);
        assert!(RunLock::take(folder.path()).is_err(), "a copy holds it still");
        drop(copy);
        RunLock::take(folder.path()).unwrap();
    }
}
