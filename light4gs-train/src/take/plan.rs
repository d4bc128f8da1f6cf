//! The segments of a take: which frames each of them shows and is trained on.

use std::collections::BTreeSet;

use light4gs_codec::take::SegmentTimes;
use light4gs_data::Scene;
use serde::{Deserialize, Serialize};

use crate::error::TrainError;

/// Frames on each side of a segment on which it is trained as well, so that no join is at the end of a motion.
const MARGIN: usize = 4;
/// A segment of fewer frames has no motion to learn.
const FEWEST: usize = 4;

/// A segment of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedSegment {
    /// The first frame that it shows, counted from 0.
    pub first: usize,
    /// The number of frames that it shows.
    pub frames: usize,
    /// The first frame that it is trained on.
    pub trained_first: usize,
    /// The number of frames that it is trained on.
    pub trained_frames: usize,
}

impl PlannedSegment {
    /// Shows the frames from `first` to before `end` of a take of `frames` frames.
    fn showing(first: usize, end: usize, frames: usize) -> Self {
        let trained_first = first.saturating_sub(MARGIN);
        let trained_end = (end + MARGIN).min(frames);
        Self { first, frames: end - first, trained_first, trained_frames: trained_end - trained_first }
    }
}

/// The number of times that images of a scene have.
fn times(data: &Scene) -> usize {
    let frames = data.train.iter().chain(&data.test);
    frames.map(|frame| frame.time.to_bits()).collect::<BTreeSet<_>>().len()
}

/// How a take is divided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TakePlan {
    /// Frames of the take: times that images have.
    pub frames: usize,
    /// Seconds from the first frame to the last.
    pub seconds: f64,
    /// In the order of their times.
    pub segments: Vec<PlannedSegment>,
}

impl TakePlan {
    /// Segments of about this number of seconds each, of equal length to within a frame.
    ///
    /// # Errors
    /// [`TrainError::Input`] where a segment would have fewer than four frames, or the take has fewer.
    pub fn of(data: &Scene, seconds: f64, segment: f64) -> Result<Self, TrainError> {
        Self::new(times(data), seconds, segment)
    }

    /// The plan of a longer take that begins with this one: its segments stay, and further ones of about their length follow.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a take with no more frames, or with another interval between them.
    pub fn extended(&self, data: &Scene, seconds: f64) -> Result<Self, TrainError> {
        let frames = times(data);
        let longer = Self { frames, seconds, segments: self.segments.clone() };
        let changed = (longer.interval() / self.interval() - 1.0).abs() > 1e-3;
        if frames <= self.frames || changed {
            return Err(TrainError::Input(format!(
                "{} has {frames} frames in {seconds:.2} seconds, expected the take of {} frames in {:.2} seconds with more frames \
                 after them, at the same rate",
                data.root.display(),
                self.frames,
                self.seconds
            )));
        }
        let length = self.seconds / self.segments.len() as f64;
        let more = frames - self.frames;
        let added = more as f64 * longer.interval();
        let count = ((added / length).round() as usize).clamp(1, (more / FEWEST).max(1));
        let begin = |number: usize| self.frames + number * more / count;
        let further = (0..count).map(|number| PlannedSegment::showing(begin(number), begin(number + 1), frames));
        Ok(Self { segments: self.segments.iter().copied().chain(further).collect(), ..longer })
    }

    fn new(frames: usize, seconds: f64, segment: f64) -> Result<Self, TrainError> {
        let count = ((seconds / segment).round() as usize).max(1);
        if frames < FEWEST * count {
            return Err(TrainError::Input(format!(
                "--segment {segment}: the take has {frames} frames in {seconds:.2} seconds, so a segment would have fewer than \
                 {FEWEST}; give at least {:.2}",
                FEWEST as f64 * seconds / frames.max(1) as f64
            )));
        }
        let begin = |number: usize| number * frames / count;
        let segments = (0..count).map(|number| PlannedSegment::showing(begin(number), begin(number + 1), frames));
        Ok(Self { frames, seconds, segments: segments.collect() })
    }

    /// Whether the plan divides this very take.
    pub fn has_all_of(&self, data: &Scene) -> bool {
        times(data) == self.frames
    }

    /// Seconds from one frame to the next.
    pub fn interval(&self) -> f64 {
        self.seconds / (self.frames.max(2) - 1) as f64
    }

    /// The frames that a segment is trained on, as shares of the take's time (`data.between`).
    pub fn between(&self, segment: &PlannedSegment) -> [f64; 2] {
        let last = (self.frames.max(2) - 1) as f64;
        let end = segment.trained_first + segment.trained_frames - 1;
        [segment.trained_first as f64 / last, end as f64 / last]
    }

    /// The times of a segment in a file. It changes hands half-way between two frames, so that no rounding gives a frame to the
    /// wrong segment.
    pub fn times(&self, segment: &PlannedSegment) -> SegmentTimes {
        let at = |frame: f64| (frame * self.interval()).max(0.0);
        SegmentTimes {
            begin: at(segment.first as f64 - 0.5),
            end: at((segment.first + segment.frames) as f64 - 0.5),
            stream_begin: at(segment.trained_first as f64),
            stream_end: at((segment.trained_first + segment.trained_frames - 1) as f64),
            frames: segment.frames as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_show_every_frame_once_and_are_trained_beyond_their_joins() {
        let plan = TakePlan::new(1800, 60.0, 2.0).unwrap();
        assert_eq!(plan.segments.len(), 30);
        let mut next = 0;
        for segment in &plan.segments {
            assert_eq!(segment.first, next);
            next += segment.frames;
            assert!((59..=61).contains(&segment.frames));
            assert!(segment.trained_first <= segment.first && segment.trained_frames >= segment.frames + MARGIN);
            let [from, to] = plan.between(segment);
            assert!((0.0..to).contains(&from) && to <= 1.0);
        }
        assert_eq!(next, 1800);
        let first = plan.times(&plan.segments[0]);
        let second = plan.times(&plan.segments[1]);
        assert_eq!((first.begin, first.end), (0.0, second.begin));
        let frame = plan.segments[1].first as f64 * plan.interval();
        assert!(!first.contains(frame) && second.contains(frame) && first.contains(frame - plan.interval()));
        let last = plan.times(&plan.segments[29]);
        assert!(last.contains(60.0) && last.stream_time(60.0) == 1.0);
        assert!(second.stream_begin < second.begin && second.end < second.stream_end);
    }

    #[test]
    fn short_takes_have_one_segment_and_too_short_segments_are_refused() {
        assert_eq!(TakePlan::new(30, 1.0, 2.0).unwrap().segments.len(), 1);
        let refused = TakePlan::new(60, 2.0, 0.1).unwrap_err().to_string();
        assert!(refused.contains("--segment 0.1") && refused.contains("0.13"), "{refused}");
    }
}
