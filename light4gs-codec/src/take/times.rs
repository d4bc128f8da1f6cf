//! When a segment is shown, and what the times of its stream mean.

use super::SECTION;
use crate::{CodecError, Limits, limits::at_most};

/// The largest time, in seconds: some thirty years.
pub(super) const LONGEST: f64 = 1e9;

/// The times of a segment, in seconds of the take.
///
/// The stream of a segment usually goes beyond what is shown of it: it is trained with a margin of frames on both sides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SegmentTimes {
    /// The first time at which the segment is shown; 0 or more.
    pub begin: f64,
    /// The time at which it is not shown any more; more than `begin`.
    pub end: f64,
    /// What time 0 of the stream means; at most `begin`.
    pub stream_begin: f64,
    /// What time 1 of the stream means; more than `begin`. Where it is before `end`, the last moment stays: the last frame of a take
    /// is shown for as long as the others.
    pub stream_end: f64,
    /// Number of frames that are shown; 0 where not known.
    pub frames: u32,
}

impl SegmentTimes {
    /// Whether the segment is shown at a time: from `begin` on, and before `end`.
    pub fn contains(&self, seconds: f64) -> bool {
        self.begin <= seconds && seconds < self.end
    }

    /// The time of the stream, in [0, 1], at a time of the take in seconds.
    ///
    /// It is `q = (seconds - stream_begin) / (stream_end - stream_begin)`, where each of the three operations is rounded to
    /// binary64, to nearest, ties to even. Where `q` is not above 0 (NaN included) it is 0, where `q` is 1 or more it is 1, and
    /// otherwise it is `q` rounded to binary32, to nearest, ties to even. So every decoder has the same bits.
    ///
    /// ```
    /// use light4gs_codec::take::SegmentTimes;
    ///
    /// let times = SegmentTimes { begin: 2.0, end: 4.0, stream_begin: 1.0, stream_end: 5.0, frames: 120 };
    /// assert_eq!([0.0, 2.0, 4.0, 9.0, f64::NAN].map(|seconds| times.stream_time(seconds)), [0.0, 0.25, 0.75, 1.0, 0.0]);
    /// ```
    pub fn stream_time(&self, seconds: f64) -> f32 {
        let share = (seconds - self.stream_begin) / (self.stream_end - self.stream_begin);
        // Written so that NaN and -0 become 0.
        if share > 0.0 { share.min(1.0) as f32 } else { 0.0 }
    }

    /// Refuses times that are not finite, too large, or not in their order.
    pub(super) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        let Self { begin, end, stream_begin, stream_end, frames } = *self;
        let times = [("begin", begin), ("end", end), ("stream_begin", stream_begin), ("stream_end", stream_end)];
        for (field, seconds) in times {
            // NaN is within no range.
            if !(-LONGEST..=LONGEST).contains(&seconds) {
                let expected = format!("a number of seconds within ±{LONGEST:e}");
                return Err(CodecError::invalid(SECTION, format!("{field} of a segment"), seconds, expected));
            }
        }
        if !(0.0 <= begin && begin < end && stream_begin <= begin && begin < stream_end) {
            let found = format!("{begin} to {end} s of a stream from {stream_begin} to {stream_end} s");
            let expected = "0 or more to something later, beginning within those of its stream";
            return Err(CodecError::invalid(SECTION, "times of a segment", found, expected));
        }
        at_most(SECTION, "frames of a segment", frames.into(), limits.frames)
    }
}
