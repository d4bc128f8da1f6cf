//! The files that the player takes.

use light4gs_codec::Limits;

/// Bytes of the longest file that the player takes. Its worker has at most 4 GiB, for the file, the decoded scene and what is drawn.
pub const MOST_BYTES: u64 = 1 << 29;

/// The limits of the player: the default ones, for files that its worker can hold.
pub fn limits() -> Limits {
    Limits { file_bytes: MOST_BYTES, ..Limits::default() }
}

/// The limits of a take's index and of each stream in it. The file may be longer. The worker holds a base and some segments, so
/// each has a part of what a file may have that is alone.
pub fn take_limits() -> Limits {
    Limits { file_bytes: MOST_BYTES / 4, ..Limits::default() }
}
