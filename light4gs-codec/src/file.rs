//! Streams in files: whole, or not at all.

use std::{
    fs::{self, File},
    io::{self, Read, Write},
    path::Path,
};

use crate::{
    CodecError, Limits, SceneData, StreamInfo,
    decode, encode, info,
    stream::container::{PRELUDE, Prelude},
};

/// Writes a scene to a file, which is replaced if it exists. Returns the bytes on disk.
///
/// # Errors
/// What [`encode`] refuses, and what the system refuses. The file is then as it was before, and nothing else is left.
pub fn write_file(path: &Path, scene: &SceneData) -> Result<u64, CodecError> {
    let bytes = encode(scene)?;
    let io = |error| CodecError::Io { action: "write", path: path.to_owned(), error };
    write_atomically(path, &bytes).map_err(io)?;
    Ok(bytes.len() as u64)
}

/// Reads a scene from a file.
///
/// # Errors
/// What the system refuses, and what [`decode`] refuses; the message names the file.
pub fn read_file(path: &Path) -> Result<SceneData, CodecError> {
    read_and(path, decode)
}

/// Reads what a file holds. See [`info`].
///
/// # Errors
/// What the system refuses, and what [`info`] refuses; the message names the file.
pub fn read_info(path: &Path) -> Result<StreamInfo, CodecError> {
    read_and(path, info)
}

/// Writes `bytes` to a file so that a reader sees the old content or the new, never a part.
///
/// The bytes go to a temporary file in the same folder, are flushed to the disk and then take the name. The folder
/// must exist. On an error nothing is left behind.
///
/// ```no_run
/// light4gs_codec::write_atomically("out/eval.json".as_ref(), b"{}")?;
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// What the system refuses, and a `path` that is a folder.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder, expected the name of a file"));
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut temporary = new_temporary(folder)?;
    temporary.write_all(bytes)?;
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|error| error.error)?;
    // The content is safe and has its name. That the name outlives a power cut is for the folder, which not every
    // system can flush: a failure here must not report a file as missing that is there.
    if cfg!(unix) {
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
    Ok(())
}

/// A temporary file with the permissions that a new file gets, which vanishes unless it is given a name.
fn new_temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".light4gs-").suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Reads a file and gives it to `parse`. A file that is no stream, or claims to be too long, is not read to its end.
fn read_and<T>(path: &Path, parse: impl FnOnce(&[u8]) -> Result<T, CodecError>) -> Result<T, CodecError> {
    let io = |error| CodecError::Io { action: "read", path: path.to_owned(), error };
    let file = File::open(path).map_err(io)?;
    if file.metadata().as_ref().is_ok_and(fs::Metadata::is_dir) {
        return Err(io(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder, expected a .l4gs file")));
    }
    let mut bytes = Vec::new();
    (&file).take(PRELUDE as u64).read_to_end(&mut bytes).map_err(io)?;
    let in_file = |error| CodecError::InFile { path: path.to_owned(), error: Box::new(error) };
    let prelude = Prelude::read(&bytes, &Limits::default()).map_err(in_file)?;
    // One byte more than the header claims shows that something was appended.
    let rest = (prelude.file_bytes + 1).saturating_sub(bytes.len() as u64);
    file.take(rest).read_to_end(&mut bytes).map_err(io)?;
    parse(&bytes).map_err(in_file)
}
