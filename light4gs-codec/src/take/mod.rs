//! Takes: minutes in one file that streams and seeks.
//!
//! A take is a container around ordinary `.l4gs` streams: a *base*, which holds what stands still over the whole take, and
//! *segments* in time, each with Gaussians and a motion of its own, which are drawn together with the base's. An index near the
//! front says where they are. So a player can begin anywhere, with the base and one segment, and a file can grow while it is
//! filmed. `docs/format.md` has the layout, under "Takes".
//!
//! | task | start with |
//! |---|---|
//! | write a take | [`write_take`] |
//! | add a segment to a file | `TakeFile::append` |
//! | read one | [`Take`]; for images `PlayableTake` of the crate `light4gs-render` |
//! | fetch ranges of one over a network | [`IndexReader`] |
//! | know whether a file is one | [`is_take`] |
//!
//! ```
//! use light4gs_codec::{Limits, SceneData, encode, take::{NewSegment, SegmentTimes, Take, TakeMeta, write_take}};
//!
//! let still = encode(&SceneData::default())?;
//! // What is shown from second 2 to 4 has been trained with half a second more on both sides.
//! let times = SegmentTimes { begin: 2.0, end: 4.0, stream_begin: 1.5, stream_end: 4.5, frames: 90 };
//! let segment = NewSegment { times, stream: still.clone(), hidden: Vec::new() };
//! let bytes = write_take(&TakeMeta::default(), &still, &[segment], 8)?;
//!
//! let take = Take::read(bytes, &Limits::default())?;
//! assert_eq!(take.segment_at(1.0), None);
//! assert_eq!(take.segment_at(3.0), Some(0));
//! assert_eq!(times.stream_time(3.0), 0.5);
//! assert_eq!(*take.segment(0)?.stream, *still);
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! | file | what |
//! |---|---|
//! | `times.rs`, `meta.rs` | when a segment is shown; what is said of the whole take |
//! | `prelude.rs`, `row.rs` | the beginning of the file; a row of the index |
//! | `index.rs`, `index_reader.rs` | the index, and how it is read range by range |
//! | `hidden.rs` | which Gaussians of the base are not drawn |
//! | `new_segment.rs`, `write.rs`, `append.rs`, `take_file.rs` | writing and appending |
//! | `open.rs` | reading a take, segment by segment |
//! | `fade.rs` | which segments are drawn at a time: two around a join |
//! | `together.rs` | the Gaussians of base and segments |

#[cfg_attr(target_os = "unknown", allow(dead_code))] // Files are appended to, and a browser has none.
mod append;
mod fade;
mod hidden;
mod index;
mod index_reader;
mod meta;
mod new_segment;
mod open;
mod prelude;
mod row;
#[cfg(not(target_os = "unknown"))]
mod take_file;
#[cfg(test)]
mod tests;
mod times;
mod together;
mod write;

pub use fade::DrawnSegment;
pub use index::{SegmentPlace, TakeIndex};
pub use index_reader::IndexReader;
pub use meta::TakeMeta;
pub use new_segment::NewSegment;
pub use open::{Take, TakeSegment};
#[cfg(not(target_os = "unknown"))]
pub use take_file::TakeFile;
pub use times::SegmentTimes;
pub use together::{SegmentPart, drawn_together};
pub use write::write_take;

use crate::format::TAKE_MAGIC;

/// The section that errors of the container name.
const SECTION: &str = "take";

/// Whether a file with these first bytes is a take. Eight bytes are enough.
///
/// ```
/// assert!(light4gs_codec::take::is_take(b"\x89L4GT\r\n\x1a and more"));
/// assert!(!light4gs_codec::take::is_take(b"\x89L4GS\r\n\x1a and more"));
/// ```
pub fn is_take(bytes: &[u8]) -> bool {
    bytes.starts_with(&TAKE_MAGIC)
}
