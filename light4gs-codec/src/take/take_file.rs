//! Appending to a file.

use std::{
    fs::File,
    io::{self, ErrorKind, Seek, SeekFrom, Write},
    path::Path,
};

use super::{NewSegment, append::Append, open::read_index};
use crate::{
    CodecError, Limits,
    file::{name, open_regular},
};

/// A take in a file that grows while it is filmed or trained.
#[derive(Debug)]
pub struct TakeFile<'a> {
    path: &'a Path,
    file: File,
}

impl TakeFile<'_> {
    /// Adds a segment to a file that is a take, at any time that no other segment has.
    ///
    /// The bytes of the segment are written at the end of the file and synced, then its slot in the index is. A process that is
    /// killed in between leaves the take as it was, with bytes behind it that nothing refers to. Of several processes that
    /// append to one file, one waits for the other, where the system has locks for files.
    ///
    /// # Errors
    /// As [`write_take`](super::write_take), and what the system refuses; the message names the file. The file is then as it
    /// was, but for bytes at its end.
    pub fn append(path: &Path, segment: &NewSegment) -> Result<(), CodecError> {
        let limits = Limits::large();
        let (file, _) = open_regular(path, File::options().read(true).write(true))?;
        let take = TakeFile { path, file };
        take.lock()?;
        let index = read_index(path, &take.file, &limits)?;
        let file_bytes = take.io("read", take.file.metadata())?.len();
        let Append { tail, row_offset, row } =
            Append::plan(&index, file_bytes, segment, &limits).map_err(|error| name(path, error))?;
        take.write(file_bytes, &tail)?;
        take.write(row_offset, &row)
    }

    /// Waits until no other process appends. The lock ends with the file.
    fn lock(&self) -> Result<(), CodecError> {
        match self.file.lock() {
            Err(error) if error.kind() == ErrorKind::Unsupported => Ok(()),
            locked => self.io("lock", locked),
        }
    }

    /// Writes bytes to an offset, and waits until they are on the disk.
    fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), CodecError> {
        let write = |mut file: &File| {
            file.seek(SeekFrom::Start(offset))?;
            file.write_all(bytes)?;
            file.sync_all()
        };
        self.io("write", write(&self.file))
    }

    fn io<T>(&self, action: &'static str, result: io::Result<T>) -> Result<T, CodecError> {
        result.map_err(|error| CodecError::Io { action, path: self.path.to_owned(), error })
    }
}
