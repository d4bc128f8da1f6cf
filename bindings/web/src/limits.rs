//! The files that the player takes.

use light4gs_codec::Limits;

/// Bytes of the longest file that the player takes. Its worker has at most 4 GiB, for the file, the decoded scene and what is drawn.
pub const MOST_BYTES: u64 = 1 << 29;

/// The limits of the player: the default ones, for files that its worker can hold.
pub fn limits() -> Limits {
    Limits { file_bytes: MOST_BYTES, ..Limits::default() }
}
