//! The spiral of LLFF: a camera that swings twice around the mean of a rig while it looks at one place.

use glam::{DMat3, DVec3};
use std::f64::consts::TAU;

/// Frames of the path, and number of turns.
const FRAMES: usize = 300;
const ROUNDS: f64 = 2.0;
/// How often the path goes back and forth in one turn.
const DEPTH_RATE: f64 = 0.5;
/// The depth of the point that the path looks at, as a share between the (reciprocal) nearest and farthest depth; and
/// the factors by which these two lie beyond the bounds.
const FOCUS_SHARE: f64 = 0.75;
const CLOSE_FACTOR: f64 = 0.9;
const FAR_FACTOR: f64 = 5.0;
/// The percentile of the cameras' coordinates that gives the radii.
const RADIUS_PERCENTILE: f64 = 0.9;

/// World-to-camera rotations (OpenCV axes) and centers of the path. `poses` are camera to world, columns right, up, back;
/// `near` and `far` bound the depths that the cameras see, world units.
///
/// The reference computes its mean pose and its views with the left axis in place of the right one, so its videos are
/// mirrored. Here the axes are right-handed; everything else is the same.
pub(super) fn spiral(poses: &[(DMat3, DVec3)], near: f64, far: f64) -> Vec<(DMat3, DVec3)> {
    let count = poses.len().max(1) as f64;
    let mean = |of: fn(&(DMat3, DVec3)) -> DVec3| poses.iter().map(of).sum::<DVec3>() / count;
    let back = mean(|(rotation, _)| rotation.z_axis).normalize_or(DVec3::Z);
    let up = mean(|(rotation, _)| rotation.y_axis).normalize_or(DVec3::Y);
    let left = back.cross(up).normalize_or(DVec3::NEG_X);
    let mean_up = left.cross(back);
    let center = mean(|(_, center)| *center);
    let (close, distant) = (near * CLOSE_FACTOR, far * FAR_FACTOR);
    let focus = 1.0 / ((1.0 - FOCUS_SHARE) / close + FOCUS_SHARE / distant);
    let target = center - back * focus;
    let radius = |axis: usize| percentile(poses.iter().map(|(_, center)| center[axis].abs()).collect());
    let radii = [0, 1, 2].map(radius);
    (0..FRAMES)
        .map(|i| {
            let angle = TAU * ROUNDS * i as f64 / FRAMES as f64;
            let offset = left * (angle.cos() * radii[0])
                - mean_up * (angle.sin() * radii[1])
                - back * ((angle * DEPTH_RATE).sin() * radii[2]);
            let eye = center + offset;
            let back = (eye - target).normalize_or(DVec3::Z);
            let right = up.cross(back).normalize_or(DVec3::X);
            let upward = back.cross(right);
            (DMat3::from_cols(right, -upward, -back).transpose(), eye)
        })
        .collect()
}

/// The quantile at [`RADIUS_PERCENTILE`], linear between the sorted values; 0 without values.
fn percentile(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let place = RADIUS_PERCENTILE * last as f64;
    let below = place.floor() as usize;
    values[below] + (place - below as f64) * (values[(below + 1).min(last)] - values[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_linear_between_values() {
        assert!((percentile(vec![3.0, 1.0, 2.0]) - 2.8).abs() < 1e-12);
        assert_eq!(percentile(vec![7.0]), 7.0);
        assert_eq!(percentile(vec![]), 0.0);
    }

    #[test]
    fn every_view_is_a_rotation_that_looks_ahead() {
        let poses: Vec<(DMat3, DVec3)> =
            (0..4).map(|i| (DMat3::IDENTITY, DVec3::new(f64::from(i) - 1.5, 0.3, 0.1))).collect();
        for (rotation, center) in spiral(&poses, 2.0, 10.0) {
            assert!((rotation.determinant() - 1.0).abs() < 1e-9);
            let target = rotation * (DVec3::new(0.0, 0.0, -5.0) - center);
            assert!(target.z > 0.0, "{target}");
        }
    }
}
