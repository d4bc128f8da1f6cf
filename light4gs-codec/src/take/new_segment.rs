//! A segment that is to be written.

use super::{
    SECTION, SegmentPlace, SegmentTimes, hidden,
    index::{check_overlaps, of_segment},
};
use crate::{CodecError, Limits, bytes::check_length, info_with_limits};

/// A segment that is to be written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewSegment {
    /// When it is shown.
    pub times: SegmentTimes,
    /// A `.l4gs` stream, whose times 0 and 1 are `stream_begin` and `stream_end`.
    pub stream: Vec<u8>,
    /// For each Gaussian of the base, in its decoded order, whether it is not drawn during the segment; or nothing.
    pub hidden: Vec<bool>,
}

impl NewSegment {
    /// Its bytes, and its place where they begin at `offset`. `number` is for messages.
    pub(super) fn write(
        &self,
        number: usize,
        offset: u64,
        base_gaussians: u32,
        limits: &Limits,
    ) -> Result<(SegmentPlace, Vec<u8>), CodecError> {
        let write = || {
            self.times.check(limits)?;
            info_with_limits(&self.stream, limits)?;
            if !self.hidden.is_empty() {
                let (found, why) = (self.hidden.len(), "a bit for each Gaussian of the base, or none");
                check_length(SECTION, "hidden", found, base_gaussians.into(), why)?;
            }
            let mut bytes = hidden::write(&self.hidden);
            // At most two bytes a Gaussian, of which there are fewer than 2^31.
            let hidden_bytes = bytes.len() as u32;
            bytes.extend_from_slice(&self.stream);
            let (times, checksum) = (self.times, crc32c::crc32c(&bytes));
            Ok((SegmentPlace { times, offset, bytes: bytes.len() as u64, hidden_bytes, checksum }, bytes))
        };
        write().map_err(|error| of_segment(number, error))
    }
}

/// Refuses segments that are shown at the same time.
pub(super) fn check_times(segments: impl IntoIterator<Item = SegmentPlace>) -> Result<(), CodecError> {
    let mut sorted: Vec<SegmentPlace> = segments.into_iter().collect();
    sorted.sort_by(|a, b| a.times.begin.total_cmp(&b.times.begin));
    check_overlaps(&sorted)
}
