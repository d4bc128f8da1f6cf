//! Numbers and names as bytes: what every section is read and written with.
//!
//! | file | what |
//! |---|---|
//! | `reader.rs`, `writer.rs` | little-endian values |
//! | `sections.rs` | which sections there are, what they may hold, how their numbers are stored |
//! | `names.rs` | names that are safe to show |

pub(crate) mod names;
mod reader;
pub(crate) mod sections;
mod writer;

pub(crate) use reader::Reader;
pub(crate) use sections::{Section, check_length};
pub(crate) use writer::Writer;
