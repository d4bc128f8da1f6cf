//! Adaptive density control (3DGS, Kerbl et al. 2023, section 5.2): clone small Gaussians and split large ones where
//! the screen-space gradient is large, drop transparent ones, reset opacities.

use burn::module::Param;
use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Int, Tensor, TensorData, s};
use light4gs_model::Gaussians;

use crate::optimization::adam::Adam;
use crate::optimization::parameters::GAUSSIAN_PARAMETERS;

/// Scales of a split Gaussian's two halves are the old ones over this.
const SPLIT_SHRINK: f32 = 1.6;
/// Opacities are brought down to at most this by a reset.
const RESET_OPACITY: f32 = 0.01;

/// What the rendered views say about each Gaussian since the last densification.
#[derive(Clone, Debug)]
pub struct DensityStatistics {
    /// `[N]`: sum of the norms of the screen-space gradients.
    pub gradient_sum: Tensor<1>,
    /// `[N]`: views in which the Gaussian was on the screen.
    pub views: Tensor<1>,
    /// `[N]` in pixels.
    pub largest_radius: Tensor<1>,
}

impl DensityStatistics {
    /// For `count` Gaussians.
    pub fn new(count: usize, device: &Device) -> Self {
        let zeros = || Tensor::zeros([count], device);
        Self { gradient_sum: zeros(), views: zeros(), largest_radius: zeros() }
    }

    /// Adds a view: screen-space gradients `[N, 2]` and radii `[N]`, both off the tape.
    pub fn add(&mut self, screen_gradient: Tensor<2>, radii: Tensor<1, Int>) {
        let visible = radii.clone().greater_elem(0).float();
        let norm = screen_gradient.powi_scalar(2).sum_dim(1).sqrt().squeeze_dim::<1>(1);
        self.gradient_sum = self.gradient_sum.clone() + norm * visible.clone();
        self.views = self.views.clone() + visible;
        self.largest_radius = self.largest_radius.clone().max_pair(radii.float());
    }

    /// Keeps the rows where `keep` is set.
    pub fn keep(&mut self, keep: &[bool]) {
        let rows: Vec<i64> = (0..keep.len() as i64).filter(|row| keep[*row as usize]).collect();
        let rows = Tensor::<1, Int>::from_data(TensorData::new(rows.clone(), [rows.len()]), &self.views.device());
        for tensor in [&mut self.gradient_sum, &mut self.views, &mut self.largest_radius] {
            *tensor = tensor.clone().select(0, rows.clone());
        }
    }

    /// `[N]`: mean gradient over the views, 0 for Gaussians that were never seen.
    pub fn mean_gradients(&self) -> Vec<f32> {
        values(self.gradient_sum.clone() / self.views.clone().clamp_min(1.0))
    }
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

/// Which Gaussians are cloned and which are split. Disjoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DensifyMasks {
    /// `[N]`
    pub clone: Vec<bool>,
    /// `[N]`
    pub split: Vec<bool>,
}

impl DensifyMasks {
    /// Both need a mean gradient of at least `threshold`; what is larger than `size` (world units) is split.
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

    /// Standard normals that [`densify`] wants: three for each half of each split Gaussian.
    pub fn normals_needed(&self) -> usize {
        6 * self.split.iter().filter(|split| **split).count()
    }
}

/// Largest standard deviation of each Gaussian, world units, `[N]`.
pub fn largest_scales(gaussians: &Gaussians) -> Vec<f32> {
    values(gaussians.log_scales.val().inner().max_dim(1).exp())
}

/// Clones and splits. The result is: the originals that were not split, the clones, the first halves, the second
/// halves. Returns the source of each new row. Moments follow their rows; new rows start with none.
///
/// `normals` are standard normal numbers, `[2 · splits, 3]` row-major: the first halves' offsets in units of the
/// Gaussian's own standard deviations, then the second halves'.
pub fn densify(gaussians: &mut Gaussians, adam: &mut Adam, masks: &DensifyMasks, normals: &[f32]) -> Vec<usize> {
    let members = |mask: &[bool], wanted: bool| -> Vec<usize> {
        mask.iter().enumerate().filter(|(_, m)| **m == wanted).map(|(i, _)| i).collect()
    };
    let (kept, clones, splits) =
        (members(&masks.split, false), members(&masks.clone, true), members(&masks.split, true));
    let first_new = kept.len();
    let rows = [kept, clones, splits.clone(), splits.clone()].concat();
    let device = gaussians.means.device().inner();
    select_rows(gaussians, adam, &rows, first_new);
    if splits.is_empty() {
        return rows;
    }

    // The halves are the last rows; their offsets and shrunken scales are added to what was copied.
    let halves = 2 * splits.len();
    let before = rows.len() - halves;
    let tensors = gaussians.tensors().inner();
    let scales = tensors.log_scales.clone().slice(s![before..rows.len()]).exp();
    let normals = Tensor::<2>::from_data(TensorData::new(normals.to_vec(), [halves, 3]), &device);
    let offsets = rotate(tensors.quats.slice(s![before..rows.len()]), normals * scales);
    let pad = |change: Tensor<2>| Tensor::cat(vec![Tensor::zeros([before, 3], &change.device()), change], 0);
    let shrink = Tensor::full([halves, 3], -SPLIT_SHRINK.ln(), &device);
    replace(&mut gaussians.means, tensors.means + pad(offsets));
    replace(&mut gaussians.log_scales, tensors.log_scales + pad(shrink));
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

/// Keeps the Gaussians where `keep` is set; moments follow.
pub fn prune(gaussians: &mut Gaussians, adam: &mut Adam, keep: &[bool]) {
    let rows: Vec<usize> = keep.iter().enumerate().filter(|(_, keep)| **keep).map(|(i, _)| i).collect();
    select_rows(gaussians, adam, &rows, rows.len());
}

/// Which Gaussians survive: opacity at least `min_opacity`, and with a size limit a radius of at most
/// `max_radius` pixels and a standard deviation of at most `max_scale` world units. `[N]`
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

/// Above which size a Gaussian is dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeLimit {
    /// On the screen, pixels.
    pub max_radius: f32,
    /// Standard deviation, world units.
    pub max_scale: f32,
}

/// Brings opacities down to 0.01 at most and forgets their moments.
pub fn reset_opacity(gaussians: &mut Gaussians, adam: &mut Adam) {
    let highest = (RESET_OPACITY / (1.0 - RESET_OPACITY)).ln();
    let logits = gaussians.opacity_logits.val().inner().clamp_max(highest);
    replace(&mut gaussians.opacity_logits, logits);
    adam.reset_moments("gaussians.opacity_logits");
}

fn replace<const D: usize>(parameter: &mut Param<Tensor<D>>, value: Tensor<D>) {
    *parameter = Param::initialized(parameter.id, Tensor::from_inner(value).require_grad());
}

fn select_rows(gaussians: &mut Gaussians, adam: &mut Adam, rows: &[usize], first_new: usize) {
    let count = gaussians.len();
    let device = gaussians.means.device().inner();
    let indices: Vec<i64> = rows.iter().map(|row| *row as i64).collect();
    let rows = Tensor::<1, Int>::from_data(TensorData::new(indices, [rows.len()]), &device);
    let fresh: Vec<f32> = (0..rows.dims()[0]).map(|k| if k < first_new { 0.0 } else { 1.0 }).collect();
    let fresh = Tensor::<1>::from_data(TensorData::new(fresh, rows.dims()), &device);
    for name in GAUSSIAN_PARAMETERS {
        adam.select_rows(name, &rows, &fresh, count);
    }
    let tensors = gaussians.tensors().inner();
    replace(&mut gaussians.means, tensors.means.select(0, rows.clone()));
    replace(&mut gaussians.log_scales, tensors.log_scales.select(0, rows.clone()));
    replace(&mut gaussians.quats, tensors.quats.select(0, rows.clone()));
    replace(&mut gaussians.opacity_logits, tensors.opacity_logits.select(0, rows.clone()));
    replace(&mut gaussians.sh_dc, tensors.sh_dc.select(0, rows.clone()));
    replace(&mut gaussians.sh_rest, tensors.sh_rest.select(0, rows));
}
