//! Corrections of a capture: exposures, poses and times that are not quite what the dataset says.
//!
//! A camera that chooses its exposure by itself, poses that are off by a pixel, and a camera of a rig that runs late make the
//! training views contradict each other, and the scene becomes a blur of all of them. So a few numbers for each frame or
//! camera are learned beside the scene. They are applied to what is rendered for a training view; the file has only the
//! scene, as its average camera sees it.
//!
//! | file | contents |
//! |---|---|
//! | this file | [`CorrectionsConfig`], and [`Corrections`]: the numbers of a run |
//! | `rows` | a few numbers for each of several units, with their optimizer |
//! | `exposure` | a gain and an offset of each color channel |
//! | `poses` | a small turn and translation of a camera |
//! | `unit` | what has a correction of its own |
//! | `view` | the corrections of one view, on the tape |
//! | `fit` | the same few numbers fitted to a view that was not trained on |

mod exposure;
mod fit;
mod poses;
mod rows;
mod unit;
mod view;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use light4gs_data::{Frame, Scene};
use light4gs_keys::Bounds::{Flag, Number};
use light4gs_keys::{ITERATION, WEIGHT, keys};
use serde::Serialize;

pub use exposure::{Exposure, exposed};
pub use fit::{Fitted, ViewFit};
pub use poses::Pose;
pub use unit::CorrectionUnit;
pub use view::{GradientOfView, LearnedView, ViewCorrection};

use crate::optimization::schedule::ExponentialDecay;
use crate::stage::Stage;
use rows::{Rows, means, medians};

/// A rate of a correction, and the largest that does not leave the range of corrections in one step.
const CORRECTION_RATE: light4gs_keys::Bounds = Number { least: 1e-20, most: 0.1 };

keys! {
    /// What is corrected.
    pub struct CorrectionsConfig {
        /// Whether each camera or each frame gets a gain and an offset of its own for each color channel. Gains and
        /// offsets are learned, and are not in the file.
        exposure: CorrectionUnit = CorrectionUnit::None; CorrectionUnit::BOUNDS, "ours";
        /// Whether each camera or each frame gets a small rotation and translation of its own, which are learned.
        /// `"camera"` is for rigs that stand still. With `"frame"`, a camera that stands still gets one correction for
        /// all of its frames.
        poses: CorrectionUnit = CorrectionUnit::None; CorrectionUnit::BOUNDS, "ours";
        /// Whether the times of each camera of a rig are corrected by a learned offset.
        time_offsets: bool = false; Flag, "ours";
        /// How corrections are learned.
        corrections: CorrectionRates;
    }
}

keys! {
    /// How corrections of exposures, poses and times are learned. A correction belongs to a frame or to a camera, and
    /// is learned from the views of this frame or camera that training draws. The keys that end in `_init` and `_final`
    /// are Adam's learning rates at the beginning and at the end of a run that draws a hundred such views for each
    /// correction. If a run draws fewer, the learning rates are larger in proportion, up to three times as large. If a
    /// run draws more, the learning rates are smaller in proportion, down to a fifth.
    pub struct CorrectionRates {
        /// Poses and times are corrected from this iteration on, since in earlier iterations there is no scene to
        /// compare the frames with. Iterations are counted over both stages.
        from: usize = 300; ITERATION, "ours";
        /// Learning rate of the logarithms of exposures' gains at the first training step. The offsets of exposures (1
        /// is white) have a quarter of this learning rate.
        exposure_init: f64 = 2e-2; CORRECTION_RATE, "ours";
        /// Learning rate of exposures at the end of the run.
        exposure_final: f64 = 2e-4; CORRECTION_RATE, "ours";
        /// Weight, in the loss, of the squared logarithms of gains and the squared offsets of exposures.
        exposure_weight: f32 = 0.02; WEIGHT, "ours";
        /// Learning rate of the rotations of cameras at the first training step, in radians.
        turn_init: f64 = 1e-3; CORRECTION_RATE, "ours";
        /// Learning rate of the rotations of cameras at the end of the run, in radians.
        turn_final: f64 = 1e-5; CORRECTION_RATE, "ours";
        /// Learning rate of the translations of cameras at the first training step, in shares of the scene's extent.
        translation_init: f64 = 5e-4; CORRECTION_RATE, "ours";
        /// Learning rate of the translations of cameras at the end of the run, in shares of the scene's extent.
        translation_final: f64 = 5e-6; CORRECTION_RATE, "ours";
        /// Learning rate of the offsets of times at the first training step, in intervals between two frames.
        time_init: f64 = 4e-2; CORRECTION_RATE, "ours";
        /// Learning rate of the offsets of times at the end of the run, in intervals between two frames.
        time_final: f64 = 4e-4; CORRECTION_RATE, "ours";
    }
}

/// The rate of an exposure's offsets as a share of that of its gains: what differs between images is mostly the gain.
const OFFSET_RATE: f32 = 0.25;
/// Offsets of times are learned in every n-th iteration: there are few of them, and the derivative needs the Gaussians at two
/// more times.
const TIME_EVERY: usize = 4;
/// Largest offset of a time, either way, in intervals between two frames.
const MOST_INTERVALS: f32 = 5.0;

/// The corrections of a run, as learned so far. Rows belong to frames of the training split or to cameras.
#[derive(Clone, Debug)]
pub struct Corrections {
    rates: CorrectionRates,
    unit: CorrectionUnit,
    exposures: Option<Rows<6>>,
    poses: Option<Rows<6>>,
    times: Option<Rows<1>>,
    /// From one time to the next.
    interval: f32,
    /// Of the scene, world units.
    extent: f32,
    background: [f32; 3],
    /// The training frames as the dataset has them, without images; empty where nothing is corrected.
    frames: Vec<Frame>,
    schedule: Schedule,
}

/// The length of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Schedule {
    /// Iterations over both stages.
    pub iterations: usize,
    /// Views of an iteration.
    pub views: usize,
}

impl Schedule {
    /// Looks at each row for which the rates are given, and the least and the largest factor of them.
    const LOOKS: f64 = 100.0;
    const FACTORS: [f64; 2] = [0.2, 3.0];

    /// The looks at each of `rows` rows, if all are looked at equally often.
    fn looks(&self, rows: usize) -> f64 {
        (self.iterations * self.views) as f64 / rows as f64
    }

    /// A rate at an iteration, for one of `rows` rows that has been looked at `seen` times. A row that the sampler shows late has
    /// its whole way before it, so its rate decays with its own looks.
    fn rate(&self, first: f64, last: f64, rows: usize, seen: u32, iteration: usize) -> f32 {
        let looks = self.looks(rows);
        let [least, most] = Self::FACTORS;
        let factor = (Self::LOOKS / looks).clamp(least, most);
        let progress = (f64::from(seen) / looks).min(iteration as f64 / self.iterations as f64);
        (factor * ExponentialDecay::new(first, last, 1).at(progress)) as f32
    }
}

/// The interval between two times of a split; 1 where there is one time.
fn interval_of(frames: &[Frame]) -> f32 {
    let mut times: Vec<f32> = frames.iter().map(|frame| frame.time).collect();
    times.sort_by(f32::total_cmp);
    times.dedup();
    let span = times.last().copied().unwrap_or(0.0) - times.first().copied().unwrap_or(0.0);
    if span > 0.0 { span / (times.len() - 1) as f32 } else { 1.0 }
}

/// The number of cameras.
fn cameras(frames: &[Frame]) -> usize {
    frames.iter().map(|frame| frame.camera_id).collect::<BTreeSet<_>>().len()
}

/// Numbers that are equal if two poses are.
fn bits_of_pose(frame: &Frame) -> Vec<u32> {
    let rotation = frame.camera.rotation.to_cols_array();
    rotation.into_iter().chain(frame.camera.translation.to_array()).map(f32::to_bits).collect()
}

impl Corrections {
    /// None made yet, for a run of this length. Where all frames are of one camera, it has no offset of
    /// time and no exposure of its own, since it could differ from nothing.
    pub fn new(config: &CorrectionsConfig, data: &Scene, schedule: Schedule) -> Self {
        let frames = &data.train;
        let camera = |frame: &Frame| frame.camera_id;
        let exposures = match config.exposure {
            CorrectionUnit::None => None,
            CorrectionUnit::Camera => Rows::by(frames.iter().map(camera)),
            CorrectionUnit::Frame => Rows::by(0..frames.len()),
        };
        // One row for a camera that stands still, one a frame for one that moves.
        let placed = || frames.iter().map(|frame| (frame.camera_id, bits_of_pose(frame)));
        let poses = match config.poses {
            CorrectionUnit::None => None,
            CorrectionUnit::Camera => Rows::by(placed()).filter(|rows| rows.len() == cameras(frames)),
            CorrectionUnit::Frame => Rows::by(placed()),
        };
        let times = config.time_offsets.then(|| Rows::by(frames.iter().map(camera)));
        let mut corrections = Self {
            rates: config.corrections.clone(),
            unit: config.exposure,
            exposures,
            poses,
            times: times.flatten(),
            interval: interval_of(frames),
            extent: data.extent,
            background: data.background,
            frames: Vec::new(),
            schedule,
        };
        if !corrections.is_off() {
            corrections.frames.clone_from(frames);
        }
        corrections
    }

    /// Whether nothing is corrected.
    pub fn is_off(&self) -> bool {
        self.exposures.is_none() && self.poses.is_none() && self.times.is_none()
    }

    /// What is to be fitted to a view that was not trained on, so that it is measured as the training views were compared.
    /// `None` where nothing is corrected.
    pub fn fit(&self) -> Option<ViewFit> {
        (!self.is_off()).then(|| ViewFit {
            exposure: self.exposures.is_some(),
            pose: self.poses.is_some(),
            time: self.times.is_some(),
            interval: self.interval,
            background: self.background,
        })
    }

    /// The corrections of a training frame in an iteration of a stage; `None` where nothing is corrected. `iteration` counts
    /// over both stages.
    pub fn of_frame(&self, frame: usize, stage: Stage, iteration: usize) -> Option<ViewCorrection> {
        let begun = iteration >= self.rates.from;
        // In the coarse stage nothing moves, so times have no effect.
        let timed = begun && stage == Stage::Fine;
        (!self.is_off()).then(|| ViewCorrection {
            exposure: self.exposures.as_ref().map(|rows| rows.of(frame)),
            pose: self.poses.as_ref().filter(|_| begun).map(|rows| Pose::of(rows.of(frame))),
            intervals: self.times.as_ref().filter(|_| timed).map(|rows| rows.of(frame)[0]),
            learns_time: iteration.is_multiple_of(TIME_EVERY),
            interval: self.interval,
            background: self.background,
        })
    }

    /// One step for the frames of an iteration, from the gradient of the loss of each alone. `iteration` counts from 1 over
    /// both stages.
    pub fn learn<'a>(&mut self, views: impl IntoIterator<Item = (usize, &'a GradientOfView)>, iteration: usize) {
        let (rates, schedule, extent) = (&self.rates, self.schedule, f64::from(self.extent));
        let exposure = |rows: usize, seen: u32| {
            let gain = schedule.rate(rates.exposure_init, rates.exposure_final, rows, seen, iteration);
            std::array::from_fn(|k| if k < 3 { gain } else { OFFSET_RATE * gain })
        };
        let pose = |rows: usize, seen: u32| {
            let turn = schedule.rate(rates.turn_init, rates.turn_final, rows, seen, iteration);
            let [first, last] = [rates.translation_init, rates.translation_final].map(|rate| extent * rate);
            let translation = schedule.rate(first, last, rows, seen, iteration);
            std::array::from_fn(|k| if k < 3 { turn } else { translation })
        };
        let time = |rows: usize, seen: u32| {
            [schedule.rate(rates.time_init, rates.time_final, TIME_EVERY * rows, seen, iteration)]
        };
        let weight = 2.0 * rates.exposure_weight;
        for (frame, gradient) in views {
            if let (Some(rows), Some(gradient)) = (&mut self.exposures, gradient.exposure) {
                let values = rows.of(frame);
                let gradient = std::array::from_fn(|k| gradient[k] + weight * values[k]);
                rows.step(frame, gradient, exposure);
            }
            if let (Some(rows), Some(gradient)) = (&mut self.poses, gradient.pose) {
                rows.step(frame, gradient, pose);
            }
            if let (Some(rows), Some(gradient)) = (&mut self.times, gradient.time) {
                rows.step(frame, [gradient], time);
            }
        }
        self.keep_what_images_do_not_tell();
    }

    /// The scene could be brighter if all images were darker, turned if all cameras were, and earlier if all of them ran
    /// late. So the middle of all corrections stays where it is: of frames the mean, of cameras the median, since one of
    /// them may be far off where the others are right.
    fn keep_what_images_do_not_tell(&mut self) {
        fn shifted<const N: usize>(rows: &mut [[f32; N]], by: [f32; N], bounded: impl Fn([f32; N]) -> [f32; N]) {
            for row in rows {
                *row = bounded(std::array::from_fn(|k| row[k] - by[k]));
            }
        }
        if let Some(Rows { values, .. }) = &mut self.exposures {
            let middle = if self.unit == CorrectionUnit::Frame { means(values) } else { medians(values) };
            shifted(values, middle, exposure::bounded);
        }
        if let Some(rows) = &mut self.poses {
            let cameras: Vec<_> = rows.first_frames().map(|frame| self.frames[frame].camera).collect();
            poses::without_common_motion(&mut rows.values, &cameras);
            let extent = self.extent;
            shifted(&mut rows.values, [0.0; 6], |values| poses::bounded(values, extent));
        }
        if let Some(Rows { values, .. }) = &mut self.times {
            let middle = medians(values);
            shifted(values, middle, |[value]| [value.clamp(-MOST_INTERVALS, MOST_INTERVALS)]);
        }
    }

    /// The numbers for a checkpoint, by name.
    pub fn state(&self) -> BTreeMap<String, Vec<f32>> {
        let mut state = BTreeMap::new();
        if let Some(rows) = &self.exposures {
            rows.state("exposure", &mut state);
        }
        if let Some(rows) = &self.poses {
            rows.state("pose", &mut state);
        }
        if let Some(rows) = &self.times {
            rows.state("time", &mut state);
        }
        state
    }

    /// Takes the numbers of a checkpoint.
    ///
    /// # Errors
    /// As text: a tensor that is missing or that nobody asks for, and one that does not fit the frames.
    pub fn restore(&mut self, mut state: BTreeMap<String, Vec<f32>>) -> Result<(), String> {
        if let Some(rows) = &mut self.exposures {
            rows.restore("exposure", &mut state)?;
        }
        if let Some(rows) = &mut self.poses {
            rows.restore("pose", &mut state)?;
        }
        if let Some(rows) = &mut self.times {
            rows.restore("time", &mut state)?;
        }
        match state.keys().next() {
            Some(name) => Err(format!("tensor `corrections.{name}` belongs to nothing that is corrected")),
            None => Ok(()),
        }
    }

    /// What was learned, for readers; `None` where nothing is corrected.
    pub fn record(&self) -> Option<CorrectionsRecord> {
        let (name, camera) =
            (|frame: usize| self.frames[frame].name.clone(), |frame: usize| self.frames[frame].camera_id);
        let mut record = CorrectionsRecord::default();
        if let Some(rows) = &self.exposures {
            let exposure = |frame| ExposureRecord {
                frame: (self.unit == CorrectionUnit::Frame).then(|| name(frame)),
                camera: camera(frame),
                exposure: Exposure::of(rows.of(frame)),
            };
            record.exposures = rows.first_frames().map(exposure).collect();
        }
        if let Some(rows) = &self.poses {
            let pose = |frame| PoseRecord { frame: name(frame), camera: camera(frame), pose: Pose::of(rows.of(frame)) };
            record.poses = rows.first_frames().map(pose).collect();
        }
        if let Some(rows) = &self.times {
            let time = |frame| TimeRecord { camera: camera(frame), frames: rows.of(frame)[0] };
            record.times = rows.first_frames().map(time).collect();
        }
        (!self.is_off()).then_some(record)
    }
}

/// `corrections.json`: what a run has learned about its capture.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CorrectionsRecord {
    /// By frame or by camera.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub exposures: Vec<ExposureRecord>,
    /// By camera, or by frame of a camera that moves.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub poses: Vec<PoseRecord>,
    /// By camera.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub times: Vec<TimeRecord>,
}

/// The exposure of a frame or a camera.
#[derive(Clone, Debug, Serialize)]
pub struct ExposureRecord {
    /// The frame's name, where each has its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// Number of the camera.
    pub camera: u32,
    /// As the camera shows the scene's radiance.
    #[serde(flatten)]
    pub exposure: Exposure,
}

/// The correction of a pose.
#[derive(Clone, Debug, Serialize)]
pub struct PoseRecord {
    /// The frame's name; the first one of a camera that stands still.
    pub frame: String,
    /// Number of the camera.
    pub camera: u32,
    /// The correction.
    #[serde(flatten)]
    pub pose: Pose,
}

/// The offset of a camera's times.
#[derive(Clone, Debug, Serialize)]
pub struct TimeRecord {
    /// Number of the camera.
    pub camera: u32,
    /// How much later than its times say its frames were taken, in intervals between two frames.
    pub frames: f32,
}
