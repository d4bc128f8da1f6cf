//! Streams in files.

use std::{
    fs::{self, File, Metadata, OpenOptions},
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
    path::Path,
};

use crate::{
    CodecError, Limits, OpenStream, SceneData, StreamInfo, decode_with_limits, info_with_limits,
    stream::{
        container::{Entry, Header, PRELUDE, Prelude},
        describe,
    },
};

/// Bytes of a file that are in memory while a checksum is computed.
const PIECE: u64 = 1 << 16;

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

/// Reads what a file holds. See [`info`](crate::info). Memory is taken for the beginnings of the sections only, whatever the
/// length of the file.
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
    in_whole_file(path, limits, |stream| stream.info())
}

/// Reads a file that is a stream, and passes its bytes to `parse`. Nothing beyond its header and the heads of its sections is
/// read of a file that is no stream, that claims to be too long, that has another length than it claims, or whose sections are
/// longer than their heads say.
///
/// # Errors
/// What the system refuses to read, and what `parse` refuses; the message names the file.
pub fn read_file_and<T>(
    path: &Path,
    limits: &Limits,
    parse: impl FnOnce(&[u8]) -> Result<T, CodecError>,
) -> Result<T, CodecError> {
    in_whole_file(path, limits, |stream| parse(&stream.bytes()?))
}

/// The bytes of a file that is a stream, and what it holds: for programs that pass a file on.
///
/// # Errors
/// As [`read_info`].
pub fn read_stream(path: &Path, limits: &Limits) -> Result<(Vec<u8>, StreamInfo), CodecError> {
    in_whole_file(path, limits, |stream| {
        let bytes = stream.bytes()?;
        let info = info_with_limits(&bytes, limits)?;
        Ok((bytes, info))
    })
}

/// Reads the stream that a whole file is.
fn in_whole_file<T>(
    path: &Path,
    limits: &Limits,
    read: impl FnOnce(&StreamInFile<'_>) -> Result<T, CodecError>,
) -> Result<T, CodecError> {
    let (file, length) = open_regular(path, File::options().read(true))?;
    StreamInFile::open(path, &file, 0..length, limits)
        .and_then(|stream| read(&stream))
        .map_err(|error| name(path, error))
}

/// The bytes of a stream in a range of a file, which are read as [`read_file_and`] reads them.
pub(crate) fn read_stream_in(
    path: &Path,
    file: &File,
    range: Range<u64>,
    limits: &Limits,
) -> Result<Vec<u8>, CodecError> {
    StreamInFile::open(path, file, range, limits)?.bytes()
}

/// A file, which is no pipe and no device, and its length.
pub(crate) fn open_regular(path: &Path, options: &OpenOptions) -> Result<(File, u64), CodecError> {
    let io = |error| CodecError::Io { action: "read", path: path.to_owned(), error };
    // Checked before the file is opened: opening a pipe would wait for its writer. Once more afterwards: it may be another
    // file by then.
    fs::metadata(path).and_then(|found| only_regular(&found)).map_err(io)?;
    let file = options.open(path).map_err(io)?;
    let found = file.metadata().map_err(io)?;
    only_regular(&found).map_err(io)?;
    Ok((file, found.len()))
}

/// A stream in a file whose header has been checked, and the length of each section with its head.
#[derive(Debug)]
struct StreamInFile<'a> {
    path: &'a Path,
    file: &'a File,
    /// Where the stream begins in the file.
    begin: u64,
    limits: Limits,
    header: Header,
}

impl<'a> StreamInFile<'a> {
    fn open(path: &'a Path, file: &'a File, range: Range<u64>, limits: &Limits) -> Result<Self, CodecError> {
        let Range { start: begin, end } = range;
        let length = end.saturating_sub(begin);
        let read =
            |offset: u64, count: u64| read_at(file, path, begin + offset, count.min(length.saturating_sub(offset)));
        let prelude = Prelude::read(&read(0, PRELUDE as u64)?, limits)?;
        prelude.check_length(length)?;
        let header = Header::read(&read(0, prelude.header_bytes())?, prelude, limits)?;
        for entry in &header.entries {
            entry.check_length(&read(entry.offset, entry.head_bytes())?, limits)?;
        }
        Ok(Self { path, file, begin, limits: *limits, header })
    }

    /// Some bytes of the stream; fewer at the end of the file.
    fn read(&self, offset: u64, count: u64) -> Result<Vec<u8>, CodecError> {
        read_at(self.file, self.path, self.begin + offset, count)
    }

    /// All bytes.
    fn bytes(&self) -> Result<Vec<u8>, CodecError> {
        read_all(self.file, self.path, self.begin, self.header.prelude.file_bytes)
    }

    /// What the beginnings of the sections say. The checksums of all bytes are checked.
    fn info(&self) -> Result<StreamInfo, CodecError> {
        // A stream of the beginnings alone.
        let (mut beginnings, mut header) = (Vec::new(), self.header.clone());
        for entry in &mut header.entries {
            self.check_checksum(entry)?;
            let beginning = self.read(entry.offset, entry.head_bytes())?;
            (entry.offset, entry.bytes) = (beginnings.len() as u64, beginning.len() as u64);
            beginnings.extend(beginning);
        }
        let limits = self.limits.for_stream(self.header.prelude.file_bytes as usize);
        describe(&OpenStream::beginning(&beginnings, &header, limits), &self.header, &limits)
    }

    fn check_checksum(&self, entry: &Entry) -> Result<(), CodecError> {
        let mut sum = 0;
        for offset in (entry.offset..entry.end()).step_by(PIECE as usize) {
            sum = crc32c::crc32c_append(sum, &self.read(offset, PIECE.min(entry.end() - offset))?);
        }
        entry.check(sum)
    }
}

/// Puts the name of a file before what is wrong in it.
pub(crate) fn name(path: &Path, error: CodecError) -> CodecError {
    match error {
        io @ CodecError::Io { .. } => io,
        other => CodecError::InFile { path: path.to_owned(), error: Box::new(other) },
    }
}

fn only_regular(found: &Metadata) -> io::Result<()> {
    if found.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder, expected a .l4gs file"));
    }
    if !found.is_file() {
        let problem = "it is a pipe, a socket or a device, expected a .l4gs file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    Ok(())
}

fn from(mut file: &File, offset: u64) -> io::Result<&File> {
    file.seek(SeekFrom::Start(offset))?;
    Ok(file)
}

/// A given number of bytes of a file; fewer at its end. Their room is taken at once, or not at all.
fn read_all(file: &File, path: &Path, offset: u64, count: u64) -> Result<Vec<u8>, CodecError> {
    let mut bytes = Vec::new();
    let io = |error| CodecError::Io { action: "read", path: path.to_owned(), error };
    let size = usize::try_from(count).map_err(|_| io(io::ErrorKind::OutOfMemory.into()))?;
    bytes.try_reserve_exact(size).map_err(|_| io(io::ErrorKind::OutOfMemory.into()))?;
    from(file, offset).and_then(|file| file.take(count).read_to_end(&mut bytes)).map_err(io)?;
    Ok(bytes)
}

/// Some bytes of a file; fewer at its end.
pub(crate) fn read_at(file: &File, path: &Path, offset: u64, count: u64) -> Result<Vec<u8>, CodecError> {
    let mut bytes = Vec::new();
    let read = from(file, offset).and_then(|file| file.take(count).read_to_end(&mut bytes));
    read.map_err(|error| CodecError::Io { action: "read", path: path.to_owned(), error })?;
    Ok(bytes)
}
