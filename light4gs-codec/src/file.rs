//! Streams in files.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::Path,
};

use crate::{
    CodecError, Limits, SceneData, StreamInfo, decode_with_limits, info_with_limits,
    stream::container::{PRELUDE, Prelude},
};

/// Reads a scene from a file.
///
/// # Errors
/// What the system refuses to read, and what [`decode`](crate::decode) refuses; the message names the file.
pub fn read_file(path: &Path) -> Result<SceneData, CodecError> {
    read_file_with_limits(path, &Limits::default())
}

/// As [`read_file`], within limits of the caller.
///
/// # Errors
/// As [`read_file`].
pub fn read_file_with_limits(path: &Path, limits: &Limits) -> Result<SceneData, CodecError> {
    read_file_and(path, limits, |bytes| decode_with_limits(bytes, limits))
}

/// Reads what a file holds. See [`info`](crate::info).
///
/// # Errors
/// What the system refuses to read, and what [`info`](crate::info) refuses; the message names the file.
pub fn read_info(path: &Path) -> Result<StreamInfo, CodecError> {
    read_info_with_limits(path, &Limits::default())
}

/// As [`read_info`], within limits of the caller.
///
/// # Errors
/// As [`read_info`].
pub fn read_info_with_limits(path: &Path, limits: &Limits) -> Result<StreamInfo, CodecError> {
    read_file_and(path, limits, |bytes| info_with_limits(bytes, limits))
}

/// Reads a file and passes its bytes to `parse`. A file that is no stream, or that claims to be too long, is not read to its
/// end.
///
/// # Errors
/// What the system refuses to read, and what `parse` refuses; the message names the file.
pub fn read_file_and<T>(
    path: &Path,
    limits: &Limits,
    parse: impl FnOnce(&[u8]) -> Result<T, CodecError>,
) -> Result<T, CodecError> {
    let io = |error| CodecError::Io { action: "read", path: path.to_owned(), error };
    // Checked before the file is opened: opening a pipe would wait for its writer.
    let kind = fs::metadata(path).map_err(io)?.file_type();
    if kind.is_dir() {
        return Err(io(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder, expected a .l4gs file")));
    }
    if !kind.is_file() {
        let problem = "it is a pipe, a socket or a device, expected a .l4gs file";
        return Err(io(io::Error::new(io::ErrorKind::InvalidInput, problem)));
    }
    let file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    (&file).take(PRELUDE as u64).read_to_end(&mut bytes).map_err(io)?;
    let in_file = |error| CodecError::InFile { path: path.to_owned(), error: Box::new(error) };
    let prelude = Prelude::read(&bytes, limits).map_err(in_file)?;
    // One byte more than the header claims, to notice bytes that were appended.
    let rest = (prelude.file_bytes + 1).saturating_sub(bytes.len() as u64);
    file.take(rest).read_to_end(&mut bytes).map_err(io)?;
    parse(&bytes).map_err(in_file)
}
