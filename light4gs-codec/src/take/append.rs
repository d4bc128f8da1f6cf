//! What must be written where, so that a take has one segment more.

use super::{
    NewSegment, SECTION, TakeIndex,
    new_segment::check_times,
    row::{self, Link, Row},
};
use crate::{CodecError, Limits, limits::at_most};

/// The fewest slots of a further block of the index.
const LEAST_SLOTS: u64 = 64;

/// What makes a take longer by a segment. The take is the old one until `row` is written, and the new one afterwards.
#[derive(Debug)]
pub(super) struct Append {
    /// Bytes at the end of the file: the segment, and a further block of the index where the last one is full. They must be on
    /// the disk before the row is.
    pub(super) tail: Vec<u8>,
    /// Where the row goes.
    pub(super) row_offset: u64,
    /// The slot of the segment, or a link to the further block, which has the slot.
    pub(super) row: Row,
}

impl Append {
    /// Plans it for a file of a length in bytes.
    pub(super) fn plan(
        index: &TakeIndex,
        file_bytes: u64,
        segment: &NewSegment,
        limits: &Limits,
    ) -> Result<Self, CodecError> {
        let number = index.segments.len();
        let (place, mut tail) = segment.write(number, file_bytes, index.base_gaussians, limits)?;
        check_times(index.segments.iter().copied().chain([place]))?;
        if let Some(row_offset) = index.room.free_slot {
            return Ok(Self { tail, row_offset, row: place.write() });
        }
        // Each block is as large as all before it, so that a reader follows few links.
        let slots = index.room.capacity;
        let more = slots.max(LEAST_SLOTS).min(u64::from(limits.segments).saturating_sub(slots));
        at_most(SECTION, "slots of the index", slots + more.max(1), limits.segments)?;
        let end = file_bytes + tail.len() as u64;
        let link = Link { offset: end.next_multiple_of(row::BYTES), capacity: more as u32 };
        tail.resize((link.offset - file_bytes) as usize + row::BYTES as usize, 0);
        tail.extend(place.write());
        tail.resize((link.range().end - file_bytes) as usize, 0);
        Ok(Self { tail, row_offset: index.room.last_link, row: link.write() })
    }
}
