//! Are the cameras of a rig in step? Each camera's image changes most when something moves fast, so the curves of change
//! of two cameras look alike, and a shift between them is a shift of their clocks.

use crate::curves::{CameraCurve, camera_curves};
use crate::error::DataError;
use crate::images::ImageStore;
use crate::options::LoadOptions;
use crate::scene::Scene;

/// The share of a curve's samples that must overlap when it is shifted.
const OVERLAP: f64 = 0.5;
/// The fewest samples that two curves must share.
const LEAST_SAMPLES: usize = 6;
/// The correlation that a shifted curve must have with the others, and by how much it must be better than unshifted.
/// Curves that are noise, as of a scene where nothing moves, reach neither.
const LEAST_CORRELATION: f64 = 0.6;
const LEAST_GAIN: f64 = 0.25;
/// Of N samples, correlations differ by some `1 / √N` by chance: a gain must be larger than this times as much.
const CHANCE: f64 = 1.5;

/// A camera that is ahead of the others or behind them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfStep {
    /// See [`crate::Frame::camera_id`].
    pub camera_id: u32,
    /// The number of frames by which it shows things earlier than the others; negative: later.
    pub frames_ahead: i32,
    /// Correlation of its curve with those of the others, shifted.
    pub correlation: f64,
    /// The same without a shift.
    pub unshifted: f64,
}

/// The cameras of a rig that are out of step with the rest, from the curves of all. Of two cameras it is the second.
pub fn out_of_step(curves: &[CameraCurve]) -> Vec<OutOfStep> {
    let usual: Vec<Vec<f64>> = curves.iter().map(|curve| standardized(&curve.changes)).collect();
    let judged = if curves.len() == 2 { 1..2 } else { 0..curves.len() };
    judged.filter(|_| curves.len() > 1).filter_map(|i| judge(i, &usual, curves[i].camera_id)).collect()
}

fn judge(i: usize, curves: &[Vec<f64>], camera_id: u32) -> Option<OutOfStep> {
    let own = &curves[i];
    let length = curves.iter().map(Vec::len).min()?;
    let others =
        |k: usize| median(curves.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, curve)| curve[k]).collect());
    let others: Vec<f64> = (0..length).map(others).collect();
    let least = LEAST_SAMPLES.max((OVERLAP * length as f64).ceil() as usize);
    let most = length.checked_sub(least)? as i32;
    let at = |shift: i32| {
        let pairs = (0..length as i32).filter(|k| (0..length as i32).contains(&(k + shift)));
        correlation(&pairs.map(|k| (own[k as usize], others[(k + shift) as usize])).collect::<Vec<_>>())
    };
    let gain = |samples: usize| LEAST_GAIN.max(CHANCE / (samples as f64).sqrt());
    let (frames_ahead, correlation) =
        (-most..=most).map(|shift| (shift, at(shift))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let found = OutOfStep { camera_id, frames_ahead, correlation, unshifted: at(0) };
    (frames_ahead != 0
        && correlation >= LEAST_CORRELATION
        && correlation - found.unshifted >= gain(length - frames_ahead.unsigned_abs() as usize))
    .then_some(found)
}

/// The values with mean 0 and standard deviation 1; all 0 where they do not differ.
fn standardized(values: &[f32]) -> Vec<f64> {
    let count = values.len().max(1) as f64;
    let mean = values.iter().map(|value| f64::from(*value)).sum::<f64>() / count;
    let deviation = (values.iter().map(|value| (f64::from(*value) - mean).powi(2)).sum::<f64>() / count).sqrt();
    values.iter().map(|value| if deviation > 0.0 { (f64::from(*value) - mean) / deviation } else { 0.0 }).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Pearson's correlation; 0 where one side does not differ.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let count = pairs.len().max(1) as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| pairs.iter().map(pick).sum::<f64>() / count;
    let (x, y) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let sum = |term: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(a, b)| term(a - x, b - y)).sum::<f64>();
    let scale = (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt();
    if scale > 1e-12 { sum(&|a, b| a * b) / scale } else { 0.0 }
}

/// Images that are decoded for the curves.
const MOST_IMAGES: usize = 240;
/// Memory for them, bytes.
const MEMORY: usize = 64 << 20;

impl Scene {
    /// Finds cameras that are out of step, and synchronizes them, with a note for each.
    pub(crate) fn put_in_step(&mut self, options: &LoadOptions) -> Result<(), DataError> {
        let curves = camera_curves(self, &ImageStore::new(options, MEMORY), MOST_IMAGES)?;
        let late = out_of_step(&curves);
        let left_out = self.synchronize(&late);
        for camera in &late {
            let name = curves.iter().find(|curve| curve.camera_id == camera.camera_id).map_or("", |curve| &curve.name);
            self.notes.push(format!("camera {name} was moved by {} frames in time", camera.frames_ahead));
        }
        if left_out > 0 {
            self.notes.push(format!("{left_out} images are left out, since no other camera sees their times"));
        }
        Ok(())
    }

    /// Moves the times of cameras that are out of step to where they belong. Frames that then lie outside of `[0, 1]` are
    /// left out, since no other camera sees their time. The number of frames that are left out.
    pub fn synchronize(&mut self, cameras: &[OutOfStep]) -> usize {
        let mut times: Vec<f32> = self.train.iter().chain(&self.test).map(|frame| frame.time).collect();
        times.sort_by(f32::total_cmp);
        times.dedup();
        let step = if times.len() > 1 { 1.0 / (times.len() - 1) as f32 } else { 0.0 };
        let mut left_out = 0;
        for split in [&mut self.train, &mut self.test, &mut self.val] {
            let before = split.len();
            for frame in split.iter_mut() {
                if let Some(camera) = cameras.iter().find(|camera| camera.camera_id == frame.camera_id) {
                    frame.time += camera.frames_ahead as f32 * step;
                }
            }
            // Half a step of tolerance, for rounding; what is within is put to the end.
            split.retain(|frame| (-0.5 * step..=1.0 + 0.5 * step).contains(&frame.time));
            split.iter_mut().for_each(|frame| frame.time = frame.time.clamp(0.0, 1.0));
            left_out += before - split.len();
        }
        left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What moves: three jerks, at uneven times.
    fn jerks(at: f64) -> f64 {
        [4.0, 9.5, 17.0].iter().map(|center| (-(at - center).powi(2)).exp()).sum()
    }

    fn curves(ahead: &[i32], noise: f64) -> Vec<CameraCurve> {
        let of = |(camera, ahead): (usize, &i32)| CameraCurve {
            camera_id: camera as u32,
            name: format!("cam{camera}"),
            changes: (0..24)
                .map(|k| {
                    let jitter = noise * (f64::from(k * 37 + camera as i32 * 101) * 12.9898).sin();
                    ((1.0 + camera as f64) * jerks(f64::from(k + ahead)) + 0.3 + jitter) as f32
                })
                .collect(),
            ..CameraCurve::default()
        };
        ahead.iter().enumerate().map(of).collect()
    }

    #[test]
    fn a_camera_ahead_is_found_and_its_shift_is_exact() {
        for shift in [-5, -1, 2, 5] {
            let found = out_of_step(&curves(&[0, 0, shift, 0], 0.02));
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!((found[0].camera_id, found[0].frames_ahead), (2, shift), "{found:?}");
        }
        let pair = out_of_step(&curves(&[0, 3], 0.02));
        assert_eq!((pair.len(), pair[0].camera_id, pair[0].frames_ahead), (1, 1, 3));
    }

    #[test]
    fn cameras_in_step_and_still_scenes_are_left_alone() {
        assert_eq!(out_of_step(&curves(&[0, 0, 0, 0], 0.05)), []);
        let mut still = curves(&[0, 0, 0], 0.0);
        still.iter_mut().for_each(|curve| curve.changes.fill(0.25));
        assert_eq!(out_of_step(&still), []);
        assert_eq!((out_of_step(&curves(&[0], 0.0)), out_of_step(&[])), (vec![], vec![]));
        // Ten images of a rig in step, of which chance makes one fit better three images later: 0.92 against 0.63.
        let few =
            |camera_id, changes: [f32; 9]| CameraCurve { camera_id, changes: changes.to_vec(), ..Default::default() };
        let others = [1.1, 1.0, 0.7, 0.9, 1.5, 0.8, 1.4, 1.4, 1.0];
        let one = [1.2, 1.4, 1.2, 1.4, 1.5, 1.2, 1.6, 1.5, 0.9];
        assert_eq!(out_of_step(&[few(0, others), few(1, others), few(2, one)]), []);
        let mut short = curves(&[0, 4], 0.0);
        short.iter_mut().for_each(|curve| curve.changes.truncate(3));
        assert_eq!(out_of_step(&short), []);
    }

    #[test]
    fn times_are_moved_and_what_no_other_camera_sees_is_left_out() {
        use crate::{Camera, Frame, PointCloud, SplitFrames};
        let camera = Camera::look_at(glam::Vec3::X, glam::Vec3::ZERO, glam::Vec3::Z, 1.0, 8, 8);
        let frame = |camera_id, i: u16| Frame {
            camera_id,
            ..Frame::new(format!("{i}"), camera, f32::from(i) / 4.0, "a.png".into(), (8, 8))
        };
        let frames = |camera_id| (0..5).map(move |i| frame(camera_id, i));
        let splits = SplitFrames { test: frames(0).collect(), train: frames(1).collect(), ..Default::default() };
        let cloud = PointCloud::random(20, 1.0, 0);
        let mut scene = Scene::new("a", std::path::Path::new("a"), splits, cloud, [0.0; 3]).unwrap();
        let ahead = OutOfStep { camera_id: 1, frames_ahead: 2, correlation: 1.0, unshifted: 0.0 };
        assert_eq!(scene.synchronize(&[ahead]), 2);
        let times = |frames: &[Frame]| frames.iter().map(|frame| frame.time).collect::<Vec<_>>();
        assert_eq!((times(&scene.train), scene.test.len()), (vec![0.5, 0.75, 1.0], 5));
    }
}
