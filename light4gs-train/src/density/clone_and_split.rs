//! The edits of adaptive density control (3DGS, Kerbl et al. 2023, section 5.2): clone small Gaussians and split large
//! ones where the screen-space gradient is large, remove transparent ones, reset opacities.

use burn::tensor::{Tensor, TensorData, s};
use light4gs_model::attributes::OPACITY_LOGITS;
use light4gs_model::ops::activation::sigmoid;
use light4gs_model::{GaussianTensors, Gaussians};

use super::GaussianEditor;

/// Scales of a split Gaussian's two halves are its own divided by this.
const SPLIT_SHRINK: f32 = 1.6;
/// A reset lowers opacities to at most this.
const RESET_OPACITY: f32 = 0.01;

/// Which Gaussians are cloned and which are split. Disjoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DensifyMasks {
    /// `[N]`
    pub clone: Vec<bool>,
    /// `[N]`
    pub split: Vec<bool>,
}

impl DensifyMasks {
    /// Both need a mean gradient of at least `threshold`; of these, Gaussians larger than `size` (world units) are
    /// split.
    pub fn new(mean_gradients: &[f32], largest_scales: &[f32], threshold: f32, size: f32) -> Self {
        let chosen = |large: bool| {
            mean_gradients
                .iter()
                .zip(largest_scales)
                .map(|(gradient, scale)| *gradient >= threshold && (*scale > size) == large)
                .collect()
        };
        Self { clone: chosen(false), split: chosen(true) }
    }

    /// Standard normals that [`densify`] needs: three for each half of each split Gaussian.
    pub fn normals_needed(&self) -> usize {
        6 * self.split.iter().filter(|split| **split).count()
    }
}

/// The `count`-th largest gradient, `count` from 1: a threshold that `count` Gaussians reach, or more if some gradients are
/// equal. Infinite for a `count` of 0, and 0 if there are at most `count` gradients.
pub fn least_of_largest(gradients: &[f32], count: usize) -> f32 {
    match count {
        0 => f32::INFINITY,
        _ if count >= gradients.len() => 0.0,
        _ => *gradients.to_vec().select_nth_unstable_by(count - 1, |a, b| b.total_cmp(a)).1,
    }
}

/// Largest standard deviation of each Gaussian, world units, `[N]`.
pub fn largest_scales(gaussians: &Gaussians) -> Vec<f32> {
    values(gaussians.log_scales.val().inner().max_dim(1).exp())
}

/// Clones and splits. A new Gaussian is a copy of its source in everything but position and scale. The result is: the
/// originals that were not split, the clones, the first halves, the second halves. Returns the source of each new row.
/// Moments move with their rows; new rows start with none.
///
/// `normals` are standard normal numbers, `[2 · splits, 3]` row-major: the first halves' offsets in units of the
/// Gaussian's own standard deviations, then the second halves'.
pub fn densify(gaussians: &mut GaussianEditor, masks: &DensifyMasks, normals: &[f32]) -> Vec<usize> {
    let members = |mask: &[bool], wanted: bool| -> Vec<usize> {
        mask.iter().enumerate().filter(|(_, m)| **m == wanted).map(|(i, _)| i).collect()
    };
    let (kept, clones, splits) =
        (members(&masks.split, false), members(&masks.clone, true), members(&masks.split, true));
    let first_new = kept.len();
    let rows = [kept, clones, splits.clone(), splits.clone()].concat();
    gaussians.select_rows(&rows, first_new);
    if splits.is_empty() {
        return rows;
    }

    // The halves are the last rows; their offsets and the change of their scales are added to the copies.
    let halves = 2 * splits.len();
    let before = rows.len() - halves;
    gaussians.update(|tensors| {
        let device = tensors.means.device();
        let scales = tensors.log_scales.clone().slice(s![before..rows.len()]).exp();
        let normals = Tensor::<2>::from_data(TensorData::new(normals.to_vec(), [halves, 3]), &device);
        let offsets = rotate(tensors.quats.clone().slice(s![before..rows.len()]), normals * scales);
        let pad = |change: Tensor<2>| Tensor::cat(vec![Tensor::zeros([before, 3], &change.device()), change], 0);
        let shrink = Tensor::full([halves, 3], -SPLIT_SHRINK.ln(), &device);
        let (means, log_scales) = (tensors.means + pad(offsets), tensors.log_scales + pad(shrink));
        GaussianTensors { means, log_scales, ..tensors }
    });
    rows
}

/// Rotates vectors `[M, 3]` by quaternions `[M, 4]` of any length.
fn rotate(quats: Tensor<2>, vectors: Tensor<2>) -> Tensor<2> {
    let norm = quats.clone().powi_scalar(2).sum_dim(1).sqrt();
    let quats = quats / norm;
    let count = quats.dims()[0];
    let w = quats.clone().slice([0..count, 0..1]);
    let axis = quats.slice([0..count, 1..4]);
    // v + 2 w (u × v) + 2 u × (u × v)
    let first = cross(axis.clone(), vectors.clone());
    let second = cross(axis, first.clone());
    vectors + (first * w + second) * 2.0
}

fn cross(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    let count = a.dims()[0];
    let column = |t: &Tensor<2>, i: usize| t.clone().slice([0..count, i..i + 1]);
    let component = |i: usize, j: usize| column(&a, i) * column(&b, j) - column(&a, j) * column(&b, i);
    Tensor::cat(vec![component(1, 2), component(2, 0), component(0, 1)], 1)
}

/// Which Gaussians are kept: opacity at least `min_opacity`, and with a size limit a radius of at most `max_radius`
/// pixels and a standard deviation of at most `max_scale` world units. `[N]`
pub fn survivors(
    gaussians: &Gaussians,
    min_opacity: f32,
    size_limit: Option<SizeLimit>,
    largest_radius: &Tensor<1>,
) -> Vec<bool> {
    let opacities = values(sigmoid(gaussians.opacity_logits.val().inner()));
    let mut keep: Vec<bool> = opacities.iter().map(|opacity| *opacity >= min_opacity).collect();
    if let Some(limit) = size_limit {
        let radii = values(largest_radius.clone());
        for (i, scale) in largest_scales(gaussians).into_iter().enumerate() {
            keep[i] &= radii[i] <= limit.max_radius && scale <= limit.max_scale;
        }
    }
    keep
}

/// The size above which a Gaussian is removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeLimit {
    /// On the screen, pixels.
    pub max_radius: f32,
    /// Standard deviation, world units.
    pub max_scale: f32,
}

/// Lowers opacities to at most 0.01 and sets their moments to zero.
pub fn reset_opacity(gaussians: &mut GaussianEditor) {
    let highest = (RESET_OPACITY / (1.0 - RESET_OPACITY)).ln();
    gaussians.update(|tensors| {
        let opacity_logits = tensors.opacity_logits.clamp_max(highest);
        GaussianTensors { opacity_logits, ..tensors }
    });
    gaussians.reset_moments(OPACITY_LOGITS);
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

#[cfg(test)]
mod tests {
    use super::least_of_largest;

    #[test]
    fn so_many_reach_the_least_of_the_largest() {
        let gradients = [0.3, 0.1, 0.5, 0.2];
        for (count, least) in [(0, f32::INFINITY), (1, 0.5), (2, 0.3), (3, 0.2), (4, 0.0), (9, 0.0)] {
            assert_eq!(least_of_largest(&gradients, count), least);
        }
    }
}
