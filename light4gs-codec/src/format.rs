//! The beginning of every file.

/// The first bytes of every stream. One is not ASCII and two are line ends, so that a transfer as text changes them.
pub const MAGIC: [u8; 8] = *b"\x89L4GS\r\n\x1a";

/// The first bytes of every take, a file of several streams. See [`crate::take`].
pub const TAKE_MAGIC: [u8; 8] = *b"\x89L4GT\r\n\x1a";

/// The version of the format, of streams and of takes.
pub const VERSION: u16 = 1;
