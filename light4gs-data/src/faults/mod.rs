//! What makes a capture hard to learn from, each with what to do about it. Every rule has a threshold.
//!
//! | file | rules |
//! |---|---|
//! | `poses` | cameras all in one place, little parallax, few images with a pose |
//! | `images` | blur, no detail at this size, exposure that jumps, motion too fast for the rate |
//! | `clocks` | cameras that are out of step |

mod clocks;
mod images;
mod poses;

use crate::curves::CameraCurve;
use crate::scene::Scene;

/// The faults of a capture, from its poses and points, and from what its images are like: sentences. Empty for a good one.
pub fn capture_faults(scene: &Scene, curves: &[CameraCurve]) -> Vec<String> {
    let of_poses = [poses::unposed(scene), poses::parallax(scene)];
    let of_images =
        [images::soft(scene, curves), images::blurred(curves), images::exposure(curves), images::fast(curves)];
    of_poses.into_iter().chain(of_images).flatten().chain(clocks::out_of_step(curves)).collect()
}

/// The median, of numbers that are not NaN; `None` if there are none.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.filter(|value| !value.is_nan()).collect();
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests;
