//! The content of an answer, whole or a range of its bytes.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::connections::Connection;

/// Bytes of a file that are in memory at once.
const PIECE: u64 = 64 << 10;

/// The content of an answer. A scene is there once, for all who read it; a file stays where it is.
#[derive(Clone, Debug)]
pub(super) enum Body {
    Fixed(&'static [u8]),
    Shared(Arc<Vec<u8>>),
    /// A regular file, which may have grown when it is read.
    File(Arc<Path>),
}

impl From<&'static str> for Body {
    fn from(text: &'static str) -> Self {
        Self::Fixed(text.as_bytes())
    }
}

impl From<Arc<Vec<u8>>> for Body {
    fn from(bytes: Arc<Vec<u8>>) -> Self {
        Self::Shared(bytes)
    }
}

impl From<String> for Body {
    fn from(text: String) -> Self {
        Self::Shared(Arc::new(text.into_bytes()))
    }
}

/// A body whose length is known.
#[derive(Debug)]
pub(super) enum OpenBody<'a> {
    Bytes(&'a [u8]),
    File(File, u64),
}

impl Body {
    /// Finds out how long it is.
    ///
    /// # Errors
    /// A file that cannot be read, or that is none.
    pub(super) fn open(&self) -> Result<OpenBody<'_>> {
        match self {
            Self::Fixed(bytes) => Ok(OpenBody::Bytes(bytes)),
            Self::Shared(bytes) => Ok(OpenBody::Bytes(bytes)),
            Self::File(path) => {
                // Before it is opened: opening a pipe would wait for its writer.
                if !std::fs::metadata(path)?.is_file() {
                    return Err(Error::new(ErrorKind::InvalidInput, "it is no regular file"));
                }
                let file = File::open(path)?;
                let bytes = file.metadata()?.len();
                Ok(OpenBody::File(file, bytes))
            }
        }
    }
}

impl OpenBody<'_> {
    pub(super) fn len(&self) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes.len() as u64,
            Self::File(_, bytes) => *bytes,
        }
    }

    /// Sends a range of its bytes.
    ///
    /// # Errors
    /// A client that takes nothing any more; a file that has become shorter.
    pub(super) fn send(&mut self, range: Range<u64>, connection: &Connection) -> Result<()> {
        match self {
            Self::Bytes(bytes) => connection.send(&bytes[range.start as usize..range.end as usize]),
            Self::File(file, _) => {
                file.seek(SeekFrom::Start(range.start))?;
                let mut left = range.end - range.start;
                let mut piece = vec![0; PIECE.min(left) as usize];
                while left > 0 {
                    let count = PIECE.min(left) as usize;
                    file.read_exact(&mut piece[..count])?;
                    connection.send(&piece[..count])?;
                    left -= count as u64;
                }
                Ok(())
            }
        }
    }
}
