//! The beginning of every stream.

/// The first bytes of every stream. One is not ASCII and two are line ends, so that a transfer as text changes them.
pub const MAGIC: [u8; 8] = *b"\x89L4GS\r\n\x1a";

/// The version of the format.
pub const VERSION: u16 = 1;
