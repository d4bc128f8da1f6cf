//! The content of a file, sampled.

use crate::error::DataError;
use crate::regular_file::open_regular_file;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Number of blocks that are read, and their size in bytes. A file that is no longer than all of them together is read
/// as a whole.
const BLOCKS: u64 = 8;
const BLOCK: u64 = 4096;

/// Length and hash of a file.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(crate) struct Content {
    /// Bytes.
    length: u64,
    /// The first 16 bytes of the SHA-256 of the blocks, hexadecimal.
    hash: String,
}

impl Content {
    pub(crate) fn of(path: &Path) -> Result<Self, DataError> {
        sampled(path).map_err(DataError::io("read", path))
    }

    /// Length and hash as 8 hexadecimal digits: enough to notice a file that was damaged or replaced, not a forgery.
    pub(crate) fn short(&self) -> String {
        let mut hash = Sha256::new();
        hash.update(self.length.to_le_bytes());
        hash.update(self.hash.as_bytes());
        hexadecimal(&hash.finalize()[..4])
    }
}

fn sampled(path: &Path) -> io::Result<Content> {
    let mut file = open_regular_file(path)?;
    let length = file.metadata()?.len();
    let mut hash = Sha256::new();
    if length <= BLOCKS * BLOCK {
        let mut bytes = Vec::with_capacity(length as usize);
        file.read_to_end(&mut bytes)?;
        hash.update(&bytes);
    } else {
        let mut block = [0; BLOCK as usize];
        for i in 0..BLOCKS {
            // The first block and the last one are at the file's ends.
            file.seek(SeekFrom::Start((length - BLOCK) / (BLOCKS - 1) * i))?;
            file.read_exact(&mut block)?;
            hash.update(block);
        }
    }
    Ok(Content { length, hash: hexadecimal(&hash.finalize()[..16]) })
}

pub(super) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
