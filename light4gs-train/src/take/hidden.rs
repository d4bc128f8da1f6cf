//! Gaussians of the base that a segment hides.
//!
//! The base has what stands still for most of the take. What rests there for a while, and has gone or has not yet come in this
//! segment, would stand in its images as a ghost. A Gaussian is a ghost where nearly all views that see it differ from the
//! base there: the error of a view at a Gaussian is the mean of the residual over its pixels, weighted as they blend it. Who
//! passes before a wall covers it in some views only, so the wall stays.

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::GaussianArrays;
use light4gs_data::SH_C0;
use light4gs_model::{GaussianTensors, Gaussians, Splatter};

use super::residual::Residual;

/// A view differs at a Gaussian from this mean absolute difference of a color on, of 1.
const DIFFERS: f64 = 0.1;
/// Blended pixels from which on a view sees a Gaussian.
const SEEN: f64 = 2.0;
/// A ghost is seen by at least this number of views, and by this share of them differently.
const LEAST_VIEWS: usize = 3;
const SHARE: f64 = 0.8;

/// The indices of the Gaussians to hide, rising. `device` is one without autodiff.
pub(super) fn hidden(base: &GaussianArrays, residuals: &[Residual<'_>], device: &Device) -> Vec<u32> {
    let count = base.len();
    let (mut seen, mut differ) = (vec![0_usize; count], vec![0_usize; count]);
    let gaussians = Gaussians::from_arrays(base, device).tensors().inner();
    for residual in residuals {
        for (index, [error, weight]) in blamed(&gaussians, residual, device).into_iter().enumerate() {
            if weight >= SEEN {
                seen[index] += 1;
                differ[index] += usize::from(error > DIFFERS * weight);
            }
        }
    }
    let is_ghost = |index: usize| seen[index] >= LEAST_VIEWS && differ[index] as f64 >= SHARE * seen[index] as f64;
    (0..count).filter(|index| is_ghost(*index)).map(|index| index as u32).collect()
}

/// For each Gaussian the sums over the pixels of a view of blending weight times residual, and of the weight alone. They are
/// the derivatives of a weighted sum of the image with respect to the Gaussian's color.
fn blamed(gaussians: &GaussianTensors, residual: &Residual<'_>, device: &Device) -> Vec<[f64; 2]> {
    let autodiff = device.clone().autodiff();
    let count = gaussians.means.dims()[0];
    let camera = &residual.frame.camera;
    // Gray, so that no color is clamped.
    let colors = Tensor::<3>::zeros([count, 1, 3], &autodiff).require_grad();
    let gray = GaussianTensors {
        means: Tensor::from_inner(gaussians.means.clone()),
        log_scales: Tensor::from_inner(gaussians.log_scales.clone()),
        quats: Tensor::from_inner(gaussians.quats.clone()),
        opacity_logits: Tensor::from_inner(gaussians.opacity_logits.clone()),
        sh_dc: colors.clone(),
        sh_rest: Tensor::zeros([count, 0, 3], &autodiff),
        further: Vec::new(),
    };
    let image = Splatter::new([0.0; 3], 0).render(gray, camera, None).image;
    let weights: Vec<f32> = residual.error.iter().flat_map(|error| [*error, 1.0, 0.0]).collect();
    let weights = Tensor::<3>::from_data(TensorData::new(weights, image.dims()), &autodiff);
    let gradients = (image * weights).sum().backward();
    let Some(gradient) = colors.grad(&gradients) else { return vec![[0.0; 2]; count] };
    let numbers: Vec<f32> = gradient.into_data().iter().collect();
    numbers
        .as_chunks::<3>()
        .0
        .iter()
        .map(|[error, weight, _]| [*error, *weight].map(|sum| f64::from(sum / SH_C0)))
        .collect()
}
