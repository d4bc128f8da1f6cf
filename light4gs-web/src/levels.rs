//! Levels of detail: fewer, larger Gaussians in place of those of a scene, for images that must be made quickly.
//!
//! The method is stochastic simplification (Cook, Halstead, Planck and Ryu, 2007). A Gaussian is kept with a probability
//! `p` in proportion to its significance, at most 1, and what is kept gets `1 / p` times its area. So the expected area
//! times opacity stays as it is, and what covers much is not changed at all. The choice is systematic along a Morton
//! curve: of neighbors that are dropped together, about one in `1 / p` stays and covers the others.

use light4gs_codec::GaussianArrays;
use light4gs_codec::rendering::MIN_ALPHA;

use crate::gaussians::{opacity, scales};

/// A level of fewer Gaussians is not worth its memory.
const FEWEST: usize = 3000;
/// Each level has half of the Gaussians of the one before.
const MOST_LEVELS: u32 = 5;

/// What a level is made of.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Selection {
    /// Gaussians of the scene, ascending.
    pub(crate) indices: Vec<u32>,
    /// Factors of their areas.
    pub(crate) growth: Vec<f32>,
}

/// How many levels a scene of so many Gaussians has besides itself.
pub(crate) fn levels(count: usize) -> u32 {
    (1..=MOST_LEVELS).take_while(|&level| count >> level >= FEWEST).count() as u32
}

/// Chooses about `count` Gaussians.
pub(crate) fn select(gaussians: &GaussianArrays, count: usize) -> Selection {
    let significance: Vec<f32> = (0..gaussians.len()).map(|index| significance(gaussians, index)).collect();
    let threshold = threshold(&significance, count);
    let mut chosen = Vec::with_capacity(count + 1);
    let mut sum = 0.5;
    for index in along_curve(&gaussians.means) {
        let significance = f64::from(significance[index as usize]);
        let probability = if significance < threshold { significance / threshold } else { 1.0 };
        let before = f64::floor(sum);
        sum += probability;
        if f64::floor(sum) > before && probability > 0.0 {
            chosen.push((index, (1.0 / probability) as f32));
        }
    }
    chosen.sort_unstable_by_key(|&(index, _)| index);
    let (indices, growth) = chosen.into_iter().unzip();
    Selection { indices, growth }
}

/// Opacity times the mean of the projected area over all directions, up to a factor: by Cauchy's formula that area is a
/// quarter of the surface of a convex body, here of a box. 0 for what no view shows.
fn significance(gaussians: &GaussianArrays, index: usize) -> f32 {
    let opacity = opacity(gaussians.opacity_logits[index]);
    let [a, b, c] = scales(gaussians.log_scales[index]);
    let significance = opacity * (a * b + b * c + c * a);
    if opacity >= MIN_ALPHA && significance.is_finite() { significance } else { 0.0 }
}

/// The significance from which on a Gaussian is kept for certain, so that the probabilities of all have the sum `count`.
fn threshold(significance: &[f32], count: usize) -> f64 {
    let mut falling = significance.to_vec();
    falling.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut rest: f64 = falling.iter().map(|&value| f64::from(value)).sum();
    for (certain, &next) in falling.iter().enumerate().take(count) {
        let threshold = rest / (count - certain) as f64;
        if f64::from(next) <= threshold {
            return threshold;
        }
        rest -= f64::from(next);
    }
    0.0
}

/// The indices of points in the order of a Morton curve.
fn along_curve(points: &[[f32; 3]]) -> Vec<u32> {
    const CELLS: f32 = (1 << 21) as f32;
    let mut corners = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for point in points.iter().filter(|point| point.iter().all(|x| x.is_finite())) {
        for (axis, &x) in point.iter().enumerate() {
            corners[0][axis] = corners[0][axis].min(x);
            corners[1][axis] = corners[1][axis].max(x);
        }
    }
    let side = (0..3).map(|axis| corners[1][axis] - corners[0][axis]).fold(f32::MIN_POSITIVE, f32::max);
    let code = |point: &[f32; 3]| {
        let cell = |axis: usize| ((point[axis] - corners[0][axis]) / side * CELLS).min(CELLS - 1.0) as u64;
        (0..3).fold(0, |code, axis| code | spread(cell(axis)) << axis)
    };
    let mut keys: Vec<(u64, u32)> = points.iter().map(code).zip(0..).collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, index)| index).collect()
}

/// The lowest 21 bits with two zeros between each and the next.
fn spread(mut bits: u64) -> u64 {
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}
