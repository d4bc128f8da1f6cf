//! Numbers and names as bytes, for reading and writing all sections.
//!
//! | file | what |
//! |---|---|
//! | `reader.rs`, `writer.rs` | little-endian values |
//! | `sections.rs` | which sections there are, what they may hold, how their numbers are stored |
//! | `names.rs` | names that are safe to print |

pub(crate) mod names;
mod reader;
pub(crate) mod sections;
mod writer;

pub(crate) use reader::Reader;
pub(crate) use sections::{Section, check_length};
pub(crate) use writer::Writer;
