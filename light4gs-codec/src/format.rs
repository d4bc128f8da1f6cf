//! What every stream begins with.

/// The first bytes of every stream. The first is not ASCII and two line ends follow, so that a transfer as text shows.
pub const MAGIC: [u8; 8] = *b"\x89L4GS\r\n\x1a";

/// The version of the format.
pub const VERSION: u16 = 1;
