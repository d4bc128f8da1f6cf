//! Which points the cameras see.

use crate::frame::Frame;
use glam::Vec3;
use rayon::prelude::*;

/// Points that are looked at, of more of them.
const MOST_POINTS: usize = 4096;
/// Cameras that look, of more of them.
const MOST_CAMERAS: usize = 256;

/// How many points are in the view of at least one camera, and how many were looked at. Both points and cameras are
/// evenly chosen where there are many.
pub(super) fn share_of_points_seen(positions: &[[f32; 3]], frames: &[Frame]) -> (usize, usize) {
    let cameras: Vec<_> =
        frames.iter().step_by(frames.len().div_ceil(MOST_CAMERAS).max(1)).map(|frame| &frame.camera).collect();
    let sample: Vec<Vec3> = positions
        .iter()
        .step_by(positions.len().div_ceil(MOST_POINTS).max(1))
        .map(|position| Vec3::from(*position))
        .collect();
    let sees = |point: Vec3| {
        cameras.iter().any(|camera| {
            let (u, v, depth) = camera.project(point);
            let (width, height) = (camera.width as f32, camera.height as f32);
            depth > 0.0 && (-0.5..width - 0.5).contains(&u) && (-0.5..height - 0.5).contains(&v)
        })
    };
    (sample.par_iter().filter(|point| sees(**point)).count(), sample.len())
}
