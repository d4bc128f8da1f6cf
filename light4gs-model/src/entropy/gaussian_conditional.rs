//! The Gaussian conditional entropy model (Minnen et al. 2018, as in CompressAI; docs/design.md).
//!
//! Everything is in *y units*: a value divided by its quantization step, so that a symbol's interval has length 1.

use burn::tensor::Tensor;

use crate::ops::lower_bound::lower_bound;
use crate::ops::normal_cdf::normal_cdf;

/// Standard deviations below this count as this.
pub const SCALE_BOUND: f32 = 0.11;
/// Likelihoods below this count as this: no symbol costs more than 29.9 bits.
pub const LIKELIHOOD_BOUND: f32 = 1e-9;

/// A normal distribution for each value, all of one shape and in y units.
#[derive(Clone, Debug)]
pub struct NormalParameters<const D: usize> {
    /// Means.
    pub means: Tensor<D>,
    /// Standard deviations, raw: what is below [`SCALE_BOUND`] counts as that.
    pub scales: Tensor<D>,
}

/// Probability of the unit interval around each value, at least [`LIKELIHOOD_BOUND`].
///
/// `values` are in y units and in the shape of the parameters. Scales may be anything: they are bounded below by
/// [`SCALE_BOUND`], with the gradient of [`lower_bound`].
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::gaussian_conditional::{NormalParameters, gaussian_likelihood};
///
/// let device = Device::flex();
/// let [value, means, scales] = [0.0, 0.0, 1.0].map(|v| Tensor::<1>::from_floats([v], &device));
/// let p = gaussian_likelihood(value, NormalParameters { means, scales }).into_scalar::<f32>();
/// assert!((p - 0.382_924_9).abs() < 1e-6);
/// ```
pub fn gaussian_likelihood<const D: usize>(values: Tensor<D>, parameters: NormalParameters<D>) -> Tensor<D> {
    let NormalParameters { means, scales } = parameters;
    let scales = lower_bound(scales, SCALE_BOUND);
    // On the lower side of the mean, where the distribution function keeps its digits.
    let distance = (values - means).abs().neg();
    let upper = normal_cdf((distance.clone() + 0.5) / scales.clone());
    let lower = normal_cdf((distance - 0.5) / scales);
    lower_bound(upper - lower, LIKELIHOOD_BOUND)
}

/// Bits of a symbol of this likelihood, elementwise.
pub fn bits<const D: usize>(likelihood: Tensor<D>) -> Tensor<D> {
    likelihood.log() * -std::f64::consts::LOG2_E
}
