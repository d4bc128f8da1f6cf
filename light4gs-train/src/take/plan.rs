//! The segments of a take: which frames each of them shows and is trained on.

use std::collections::BTreeSet;
use std::ops::Range;

use light4gs_codec::take::SegmentTimes;
use light4gs_data::Scene;
use serde::{Deserialize, Serialize};

use super::growth::growth;
use crate::error::TrainError;

/// Frames on each side of a segment on which it is trained as well, so that no join is at the end of a motion.
const MARGIN: usize = 8;
/// A segment of fewer frames has no motion to learn.
const FEWEST: usize = 4;

/// Seconds of a segment, where nothing is said.
const USUAL: f64 = 2.0;
/// Frames of such a segment: fewer do not pay for what it learns anew, and more have more motion than a clip's nodes follow.
const USUAL_FRAMES: [f64; 2] = [45.0, 90.0];
/// Bytes of a base over those of a segment, where it sees as much: it is paid once, and all segments show it.
const BASE_BYTES: f64 = 2.0;
/// Of a frame: how far before the first frame after a cut its segment begins. Less than half, so that no frame before the cut
/// is meant.
const BEFORE_A_CUT: f64 = 0.4;

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
    /// Whether it begins at a cut.
    pub begins_at_cut: bool,
}

/// How long segments are to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SegmentLength {
    /// Two seconds, but 45 to 90 frames.
    Usual,
    /// About this number of seconds.
    Seconds(f64),
}

impl SegmentLength {
    /// About how many frames that are, with `interval` seconds from one to the next.
    fn frames(self, interval: f64) -> f64 {
        match self {
            Self::Usual => (USUAL / interval).clamp(USUAL_FRAMES[0], USUAL_FRAMES[1]),
            Self::Seconds(seconds) => seconds / interval,
        }
    }
}

/// The times that images of a scene have, by number.
pub(super) fn times(data: &Scene) -> Vec<f32> {
    let frames = data.train.iter().chain(&data.test);
    // Times are not negative, so their bits rise as they do.
    let times: BTreeSet<u32> = frames.map(|frame| frame.time.to_bits()).collect();
    times.into_iter().map(f32::from_bits).collect()
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
    /// The base has this number of times a clip's Gaussians and iterations, since the take sees as much more of the world than a
    /// segment does.
    pub base_growth: f64,
}

impl TakePlan {
    /// Segments of about this length, between cuts of equal length to within a frame. `cuts` are the numbers of frames before which
    /// the picture changes at once, rising; no segment goes beyond one.
    ///
    /// # Errors
    /// [`TrainError::Input`] where a segment would have fewer than four frames, or the take has fewer.
    pub fn of(data: &Scene, seconds: f64, length: SegmentLength, cuts: &[usize]) -> Result<Self, TrainError> {
        let plan = Self::new(times(data).len(), seconds, length, cuts)?;
        Ok(Self { base_growth: growth(data, &plan), ..plan })
    }

    /// The plan of a longer take that begins with this one: its segments stay, and further ones of about their length follow.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a take with no more frames, or with another interval between them.
    pub fn extended(&self, data: &Scene, seconds: f64, cuts: &[usize]) -> Result<Self, TrainError> {
        let frames = times(data).len();
        let longer = Self { frames, seconds, ..self.clone() };
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
        let length = self.frames as f64 / self.segments.len() as f64;
        let further = divided(self.frames..frames, length, cuts);
        Ok(Self { segments: self.segments.iter().copied().chain(further).collect(), ..longer })
    }

    fn new(frames: usize, seconds: f64, length: SegmentLength, cuts: &[usize]) -> Result<Self, TrainError> {
        let plan = Self { frames, seconds, segments: Vec::new(), base_growth: 1.0 };
        let wanted = length.frames(plan.interval());
        if frames < FEWEST || (wanted.round() as usize) < FEWEST {
            let wanted = wanted * plan.interval();
            return Err(TrainError::Input(format!(
                "--segment {wanted:.2}: the take has {frames} frames in {seconds:.2} seconds, so a segment would have fewer than \
                 {FEWEST}; give at least {:.2}",
                FEWEST as f64 * plan.interval()
            )));
        }
        Ok(Self { segments: divided(0..frames, wanted, cuts), ..plan })
    }

    /// Whether the plan divides this very take.
    pub fn has_all_of(&self, data: &Scene) -> bool {
        times(data).len() == self.frames
    }

    /// How many clips of the length of a segment would take as long to train.
    pub fn clips(&self) -> f64 {
        self.base_growth.powi(2) + self.segments.len() as f64
    }

    /// The base's share of the bytes of a file that is to have a certain size.
    pub fn base_share(&self) -> f64 {
        let base = BASE_BYTES * self.base_growth;
        base / (base + self.segments.len() as f64)
    }

    /// Seconds from one frame to the next.
    pub fn interval(&self) -> f64 {
        self.seconds / (self.frames.max(2) - 1) as f64
    }

    /// The frames that a segment is trained on, as shares of the take's time (`data.between`).
    pub fn between(&self, segment: &PlannedSegment) -> [f64; 2] {
        let last = (self.frames.max(2) - 1) as f64;
        let end = segment.trained_first + segment.trained_frames - 1;
        [segment.stream_begin() / last, end as f64 / last]
    }

    /// The times of a segment in a file. It changes hands half-way between two frames, so that no rounding gives a frame to the
    /// wrong segment. Where it is trained beyond a join, it fades into its neighbor there.
    pub fn times(&self, segment: &PlannedSegment) -> SegmentTimes {
        let at = |frame: f64| (frame * self.interval()).max(0.0);
        let end = segment.first + segment.frames;
        let next_begins_at_cut = self.segments.iter().any(|other| other.first == end && other.begins_at_cut);
        SegmentTimes {
            begin: at(begin_of(segment.first, segment.begins_at_cut)),
            end: at(begin_of(end, next_begins_at_cut)),
            stream_begin: at(segment.stream_begin()),
            stream_end: at((segment.trained_first + segment.trained_frames - 1) as f64),
            frames: segment.frames as u32,
        }
    }
}

impl PlannedSegment {
    /// What time 0 of its stream means, in frames of the take.
    fn stream_begin(&self) -> f64 {
        match self.begins_at_cut {
            true => begin_of(self.first, true),
            false => self.trained_first as f64,
        }
    }
}

/// Where a segment begins whose first frame is this one, in frames of the take.
fn begin_of(first: usize, at_cut: bool) -> f64 {
    first as f64 - if at_cut { BEFORE_A_CUT } else { 0.5 }
}

/// Segments of about `length` frames that show these ones, and stay between cuts.
fn divided(frames: Range<usize>, length: f64, cuts: &[usize]) -> Vec<PlannedSegment> {
    let mut begins = vec![frames.start];
    for &cut in cuts {
        // A shot with fewer frames is a part of the one before.
        if cut >= begins[begins.len() - 1] + FEWEST && cut + FEWEST <= frames.end {
            begins.push(cut);
        }
    }
    let ends = begins.iter().skip(1).copied().chain([frames.end]);
    let shots = begins.iter().zip(ends).enumerate();
    shots
        .flat_map(|(number, (&begin, end))| {
            // Where a take is extended, its last frames are there to be trained on.
            let earliest = if number == 0 { 0 } else { begin };
            let count = ((end - begin) as f64 / length).round() as usize;
            let count = count.clamp(1, (end - begin) / FEWEST);
            let begin_of = move |part: usize| begin + part * (end - begin) / count;
            (0..count).map(move |part| {
                let (first, past) = (begin_of(part), begin_of(part + 1));
                let trained_first = first.saturating_sub(MARGIN).max(earliest);
                PlannedSegment {
                    first,
                    frames: past - first,
                    trained_first,
                    trained_frames: (past + MARGIN).min(end) - trained_first,
                    begins_at_cut: number > 0 && part == 0,
                }
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(frames: usize, seconds: f64, length: f64, cuts: &[usize]) -> TakePlan {
        TakePlan::new(frames, seconds, SegmentLength::Seconds(length), cuts).unwrap()
    }

    #[test]
    fn segments_show_every_frame_once_and_are_trained_beyond_their_joins() {
        let plan = plan(1800, 60.0, 2.0, &[]);
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
    fn no_segment_goes_beyond_a_cut() {
        // The cut at 102 leaves too short a shot, and so does that at 299.
        let plan = plan(300, 9.97, 2.0, &[100, 102, 200, 299]);
        let begins: Vec<_> = plan.segments.iter().map(|segment| (segment.first, segment.begins_at_cut)).collect();
        assert_eq!(begins, [(0, false), (50, false), (100, true), (150, false), (200, true), (250, false)]);
        let trained = |number: usize| {
            let segment: &PlannedSegment = &plan.segments[number];
            (segment.trained_first, segment.trained_first + segment.trained_frames)
        };
        assert_eq!([1, 2, 3, 5].map(trained), [(42, 100), (100, 158), (142, 200), (242, 300)]);
        let [before, after] = [1, 2].map(|number| plan.times(&plan.segments[number]));
        let seconds = |frame: f64| frame * plan.interval();
        assert_eq!((before.end, after.stream_begin), (after.begin, after.begin));
        assert!(before.stream_end < before.end && before.contains(seconds(99.0)) && after.contains(seconds(100.0)));
        // The frame before the cut is not among those of the segment after it, whatever is rounded.
        let [from, _] = plan.between(&plan.segments[2]);
        assert!(from * 299.0 > 99.5 && from * 299.0 < 100.0);
    }

    #[test]
    fn the_usual_segment_has_two_seconds_but_not_too_few_frames_nor_too_many() {
        let count = |frames: usize, rate: f64| {
            let plan = TakePlan::new(frames, (frames - 1) as f64 / rate, SegmentLength::Usual, &[]).unwrap();
            plan.segments.len()
        };
        assert_eq!([count(600, 30.0), count(600, 10.0), count(600, 120.0)], [10, 13, 7]);
    }

    #[test]
    fn short_takes_have_one_segment_and_too_short_segments_are_refused() {
        assert_eq!(plan(30, 1.0, 2.0, &[]).segments.len(), 1);
        let refused = TakePlan::new(60, 2.0, SegmentLength::Seconds(0.1), &[]).unwrap_err().to_string();
        assert!(refused.contains("--segment 0.1") && refused.contains("0.14"), "{refused}");
    }
}
