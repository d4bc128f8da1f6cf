//! Files that are either complete or absent: write under a temporary name in the same folder, flush to the disk, then
//! rename.
//!
//! The writer holds a lock on its temporary file, and the lock ends with the process. So a temporary file without a
//! lock was left by a process that was killed, and is removed.

use crate::error::DataError;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// How names of temporary files begin.
const PREFIX: &str = ".light4gs-";

/// Refuses to replace anything but a file or a folder. A rename would replace `/dev/null` itself by a file, and readers
/// of a pipe would never get the data. Links into `/proc`, such as `/dev/stdout`, are refused too: the rename would
/// replace the link.
fn refuse_special_file(path: &Path) -> io::Result<()> {
    let special = fs::metadata(path).is_ok_and(|metadata| !(metadata.is_file() || metadata.is_dir()));
    let of_a_process = || fs::read_link(path).is_ok_and(|target| target.starts_with("/proc"));
    if special || of_a_process() {
        let problem = "it is a pipe, a socket or a device, and a file would replace it; name a file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    Ok(())
}

/// The number of this process; 1 in WebAssembly, which has none.
pub fn process_id() -> u32 {
    if cfg!(target_family = "wasm") { 1 } else { std::process::id() }
}

/// A name in the folder of `path` that no other call in this process uses.
///
/// The name of `path` is not a part of it, so that even a name of the longest legal length can be written.
fn sibling(path: &Path) -> PathBuf {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let count = COUNTER.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!("{PREFIX}{}-{count}.part", process_id()))
}

/// The folder of `path`.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether this is the name of a temporary file or folder of [`write_atomically`].
pub fn is_temporary_name(name: &str) -> bool {
    name.starts_with(PREFIX) && (name.ends_with(".part") || name.ends_with(".tmp"))
}

/// Removes from a folder the temporary files and folders that no process has locked: killed processes have left them.
/// Those that cannot be read or removed stay. A folder that does not exist is no error.
pub fn sweep_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(is_temporary_name) {
            remove_unless_locked(&entry.path());
        }
    }
}

/// Removes a file or folder that no process has locked.
fn remove_unless_locked(path: &Path) {
    // Only files and folders: opening a pipe would wait for its writer.
    let Ok(kind) = fs::symlink_metadata(path).map(|metadata| metadata.file_type()) else { return };
    if !(kind.is_file() || kind.is_dir()) {
        return;
    }
    let Ok(file) = File::open(path) else { return };
    if file.try_lock().is_ok() {
        let _ = if kind.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    }
}

/// Sweeps a folder before this process first writes into it.
fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let first = SWEPT.lock().is_ok_and(|mut swept| swept.insert(folder.to_owned()));
    if first {
        sweep_leftovers(folder);
    }
}

/// Locks a new temporary file. Returns false if a sweep of another process has locked or removed it: between its
/// creation and its lock it looks like a leftover.
fn claim(part: &Path, file: &File) -> bool {
    match file.lock() {
        Ok(()) => part.symlink_metadata().is_ok(),
        // A file system without locks: other processes cannot lock the file either, and leave it alone.
        Err(_) => true,
    }
}

/// Makes a folder under a temporary name beside `path`, lets `fill` fill it, and then renames it. `path` must not
/// exist, or be an empty folder.
pub(crate) fn make_folder_atomically(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<(), DataError>,
) -> Result<(), DataError> {
    sweep_once(folder_of(path));
    let (part, _locked) = loop {
        let part = sibling(path);
        fs::create_dir_all(&part).map_err(DataError::io("create", &part))?;
        match File::open(&part) {
            Ok(folder) if !claim(&part, &folder) => {}
            // A folder that cannot be opened and locked is not swept by others either.
            opened if part.is_dir() => break (part, opened),
            _ => {}
        }
    };
    let made = fill(&part).and_then(|()| {
        if path.is_dir() {
            fs::remove_dir(path).map_err(DataError::io("replace", path))?;
        }
        fs::rename(&part, path).map_err(DataError::io("create", path))
    });
    if made.is_err() {
        let _ = fs::remove_dir_all(&part);
    }
    made
}

/// Writes a file so that a reader sees either the old content or the new one, never a part.
///
/// `fill` writes the content to a temporary file in the same folder, which must exist. The content is flushed to
/// the disk (fsync), the file takes the name `path`, and on Unix the folder is flushed as well, so that the name
/// outlives a power cut. An existing file at `path` is replaced in one step. On any error it stays as it was, and the
/// temporary file is removed.
///
/// ```
/// use std::io::Write;
///
/// let path = std::env::temp_dir().join(format!("light4gs-example-{}.json", std::process::id()));
/// light4gs_data::write_atomically(&path, |file| file.write_all(b"{}"))?;
/// assert_eq!(std::fs::read(&path).unwrap(), b"{}");
/// # std::fs::remove_file(&path).unwrap();
/// # Ok::<(), light4gs_data::DataError>(())
/// ```
///
/// # Errors
/// [`DataError::Io`] naming `path`, when it is a pipe, a socket or a device, when `fill` fails, or the file cannot be created,
/// flushed or renamed.
pub fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), DataError> {
    let failed = DataError::io("write", path);
    if let Err(source) = refuse_special_file(path) {
        return Err(failed(source));
    }
    let (part, file) = match create_sibling(path) {
        Ok(created) => created,
        Err(source) => return Err(failed(source)),
    };
    // The lock is held until the rename: a sweep between the two would remove the file.
    let written = fill_and_flush(file, fill).and_then(|_locked| fs::rename(&part, path));
    if let Err(source) = written {
        // The first error is reported. If the removal fails as well, only a leftover remains.
        let _ = fs::remove_file(&part);
        return Err(failed(source));
    }
    flush_folder(path).map_err(failed)
}

/// A new, empty file beside `path`. A name that exists already (left by a process with the same number) is skipped.
fn create_sibling(path: &Path) -> io::Result<(PathBuf, File)> {
    sweep_once(folder_of(path));
    loop {
        let part = sibling(path);
        match File::create_new(&part) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Ok(file) if !claim(&part, &file) => {}
            created => return created.map(|file| (part, file)),
        }
    }
}

fn fill_and_flush(file: File, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<File> {
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    let file = writer.into_inner()?;
    file.sync_all()?;
    Ok(file)
}

/// Flushes the folder's entry of a file that has just been renamed. The file is complete, so it is no error if the
/// system cannot flush folders, or if the folder may be written but not read. A failing disk is an error.
fn flush_folder(path: &Path) -> io::Result<()> {
    if !cfg!(unix) {
        return Ok(());
    }
    let folder = folder_of(path);
    let harmless = [io::ErrorKind::Unsupported, io::ErrorKind::InvalidInput, io::ErrorKind::PermissionDenied];
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        Err(error) if !harmless.contains(&error.kind()) => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

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

    #[test]
    fn errors_name_the_file_and_leave_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = folder.path().join("missing/a.bin");
        let message = write_atomically(&nowhere, |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("cannot write") && message.contains("a.bin"), "{message}");
        let taken = folder.path().join("a folder");
        fs::create_dir(&taken).unwrap();
        let message = write_atomically(&taken, |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("a folder"), "{message}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// Run by a superuser, `light4gs decode x.l4gs --out /dev/null` once replaced the device by a file.
    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_not_replaced() {
        use std::os::unix::fs::FileTypeExt;

        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("socket");
        let _held = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&socket, &link).unwrap();
        let output = folder.path().join("output");
        std::os::unix::fs::symlink("/proc/self/fd/1", &output).unwrap();
        for path in [&socket, &link, &output] {
            let message = write_atomically(path, |_| panic!("nothing is written")).unwrap_err().to_string();
            assert!(message.contains("cannot write") && message.contains("device"), "{message}");
        }
        assert!(fs::metadata(&link).unwrap().file_type().is_socket());
        assert!(fs::symlink_metadata(&output).unwrap().is_symlink());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn what_killed_writes_left_is_swept_and_what_is_being_written_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let left = folder.path().join(".light4gs-1-0.part");
        let left_folder = folder.path().join(".light4gs-1-1.part");
        let theirs = folder.path().join(".light4gs-notes.md");
        fs::write(&left, b"half").unwrap();
        fs::create_dir_all(left_folder.join("train")).unwrap();
        fs::write(&theirs, b"mine").unwrap();
        write_atomically(&folder.path().join("a.bin"), |out| {
            assert!(!left.exists() && !left_folder.exists() && theirs.exists());
            // Meanwhile another process sweeps the folder.
            sweep_leftovers(folder.path());
            out.write_all(b"whole")
        })
        .unwrap();
        assert_eq!(fs::read(folder.path().join("a.bin")).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    /// Images of a new folder are written by all threads at once, and the first of them sweeps it.
    #[test]
    fn a_sweep_removes_nothing_that_is_being_written() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|threads| {
            let writer = threads.spawn(|| {
                for count in 0..200 {
                    let name = folder.path().join(format!("{count}.bin"));
                    write_atomically(&name, |out| out.write_all(b"whole"))?;
                    make_folder_atomically(&folder.path().join(count.to_string()), |_| Ok(()))?;
                }
                Ok::<(), DataError>(())
            });
            while !writer.is_finished() {
                sweep_leftovers(folder.path());
            }
            writer.join().unwrap().unwrap();
        });
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 400);
    }

    #[test]
    fn the_longest_name_and_the_usual_permissions() {
        let folder = tempfile::tempdir().unwrap();
        let long = folder.path().join("n".repeat(255));
        write_atomically(&long, |out| out.write_all(b"x")).unwrap();
        let plain = folder.path().join("plain");
        fs::write(&plain, b"x").unwrap();
        let permissions = |path: &Path| fs::metadata(path).unwrap().permissions();
        assert_eq!(permissions(&long), permissions(&plain));
    }
}
