//! The index of a take: what it says of itself, and where its streams are.

use std::ops::Range;

use super::{SECTION, SegmentTimes, TakeMeta, TakeSegment, hidden};
use crate::{CodecError, Limits, StreamInfo, limits::at_most};

/// Where a segment is in the file, and when it is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentPlace {
    /// When it is shown.
    pub times: SegmentTimes,
    /// Where its bytes begin in the file: first the list of hidden Gaussians, then the stream.
    pub offset: u64,
    /// Bytes of both.
    pub bytes: u64,
    /// Bytes of the list; 0 where nothing is hidden.
    pub hidden_bytes: u32,
    /// CRC-32C of both.
    pub checksum: u32,
}

/// The index of a take. [`IndexReader`](super::IndexReader) reads it from the first bytes of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct TakeIndex {
    pub(super) meta: TakeMeta,
    pub(super) base: Range<u64>,
    pub(super) base_gaussians: u32,
    /// In the order of their begins.
    pub(super) segments: Vec<SegmentPlace>,
    pub(super) room: Room,
}

/// Where a further segment can be entered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Room {
    /// Where the first unused slot is in the file.
    pub(super) free_slot: Option<u64>,
    /// Where the link of the last block is in the file.
    pub(super) last_link: u64,
    /// Slots of all blocks.
    pub(super) capacity: u64,
}

impl TakeIndex {
    /// What is said of the whole take.
    pub fn meta(&self) -> &TakeMeta {
        &self.meta
    }

    /// The bytes of the base in the file.
    pub fn base(&self) -> Range<u64> {
        self.base.clone()
    }

    /// Number of Gaussians of the base.
    pub fn base_gaussians(&self) -> u32 {
        self.base_gaussians
    }

    /// The segments that are there, by rising `begin`. They do not overlap; there may be gaps.
    pub fn segments(&self) -> &[SegmentPlace] {
        &self.segments
    }

    /// The segment that is shown at a time in seconds; none in a gap, before the first and after the last one.
    pub fn segment_at(&self, seconds: f64) -> Option<usize> {
        let after = self.segments.partition_point(|place| place.times.begin <= seconds);
        after.checked_sub(1).filter(|&last| self.segments[last].times.contains(seconds))
    }

    /// Seconds of the take: what its meta says, or the end of the last segment where that is later.
    pub fn seconds(&self) -> f64 {
        self.segments.last().map_or(self.meta.seconds, |last| self.meta.seconds.max(last.times.end))
    }

    /// Refuses a base that moves, or that has another number of Gaussians than the index says.
    ///
    /// # Errors
    /// The message names the field.
    pub fn check_base(&self, base: &StreamInfo) -> Result<(), CodecError> {
        check_still(base)?;
        if base.gaussian_count == self.base_gaussians {
            return Ok(());
        }
        let expected = format!("{}, as the prelude of the take says", self.base_gaussians);
        Err(of_base(CodecError::invalid(SECTION, "number of Gaussians", base.gaussian_count, expected)))
    }

    /// A segment from its bytes in the file, those of [`SegmentPlace::range`], which are checked against their checksum.
    ///
    /// # Errors
    /// No such segment, another number of bytes, another checksum, a list of hidden Gaussians that is damaged.
    pub fn open_segment<'a>(&self, segment: usize, bytes: &'a [u8]) -> Result<TakeSegment<'a>, CodecError> {
        let place = self.place(segment)?;
        let open = || {
            let (needed, available) = (place.bytes, bytes.len() as u64);
            if available < needed {
                let field = "segment".into();
                return Err(CodecError::Truncated { section: SECTION, field, needed, available });
            }
            if available > needed {
                return Err(CodecError::TrailingBytes { section: SECTION, bytes: available - needed });
            }
            let computed = crc32c::crc32c(bytes);
            if computed != place.checksum {
                return Err(CodecError::Checksum { section: SECTION, stored: place.checksum, computed });
            }
            // The list is shorter than the segment: the reader of the index has compared them.
            let (list, stream) = bytes.split_at(place.hidden_bytes as usize);
            let hidden = hidden::read(list, self.base_gaussians)?;
            Ok(TakeSegment { times: place.times, stream: stream.into(), hidden })
        };
        open().map_err(|error| of_segment(segment, error))
    }

    pub(super) fn place(&self, segment: usize) -> Result<&SegmentPlace, CodecError> {
        self.segments.get(segment).ok_or_else(|| {
            let expected = format!("less than {}, the number of segments", self.segments.len());
            CodecError::invalid(SECTION, "segment", segment, expected)
        })
    }
}

impl SegmentPlace {
    /// Its bytes in the file. They do not overflow: the reader of the index has compared their end with the file's.
    pub fn range(&self) -> Range<u64> {
        self.offset..self.offset.saturating_add(self.bytes)
    }

    /// Refuses what cannot be right: times, lengths, a place before the end of the base.
    pub(super) fn check(&self, base_end: u64, base_gaussians: u32, limits: &Limits) -> Result<(), CodecError> {
        self.times.check(limits)?;
        if self.offset < base_end {
            let expected = format!("{base_end} or more, behind the base");
            return Err(CodecError::invalid(SECTION, "offset of a segment", self.offset, expected));
        }
        let hidden = u64::from(self.hidden_bytes);
        at_most(SECTION, "length of a hidden list", hidden, hidden::most_bytes(base_gaussians))?;
        if self.bytes <= hidden {
            let expected = format!("more than the {hidden} bytes of its hidden list");
            return Err(CodecError::invalid(SECTION, "length of a segment", self.bytes, expected));
        }
        at_most(SECTION, "length of a segment without its hidden list", self.bytes - hidden, limits.file_bytes)?;
        if self.offset.checked_add(self.bytes).is_none() {
            return Err(CodecError::invalid(SECTION, "end of a segment", "beyond 2^64", "an end within the file"));
        }
        Ok(())
    }
}

/// Refuses segments that are shown at the same time. They are sorted by their begins.
pub(super) fn check_overlaps(segments: &[SegmentPlace]) -> Result<(), CodecError> {
    for pair in segments.windows(2) {
        let [earlier, later] = [pair[0].times, pair[1].times];
        if later.begin < earlier.end {
            let found = format!("{} to {} s and {} to {} s", earlier.begin, earlier.end, later.begin, later.end);
            let expected = "only one segment at a time";
            return Err(CodecError::invalid(SECTION, "times of two segments", found, expected));
        }
    }
    Ok(())
}

/// Refuses a base that moves.
pub(super) fn check_still(base: &StreamInfo) -> Result<(), CodecError> {
    if base.motion.kind.is_empty() {
        return Ok(());
    }
    let found = format!("{:?}", base.motion.kind);
    Err(of_base(CodecError::invalid("motion", "kind", found, "\"\": the base of a take stands still")))
}

/// An error of the stream of the base.
pub(super) fn of_base(error: CodecError) -> CodecError {
    in_part("base".into(), error)
}

/// An error of a segment.
pub(super) fn of_segment(segment: usize, error: CodecError) -> CodecError {
    in_part(format!("segment {segment}"), error)
}

fn in_part(part: String, error: CodecError) -> CodecError {
    match error {
        named @ (CodecError::Io { .. } | CodecError::InTake { .. }) => named,
        other => CodecError::InTake { part, error: Box::new(other) },
    }
}
