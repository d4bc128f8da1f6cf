//! The Gaussian conditional entropy model (Minnen et al. 2018, as in CompressAI; docs/design.md).
//!
//! Everything is in *y units*: a value divided by its quantization step, so that a symbol's interval has length 1.

use burn::tensor::Tensor;

use crate::ops::normal_likelihood::{NormalBounds, normal_likelihood};

/// Standard deviations below this are raised to it.
pub const SCALE_BOUND: f32 = 0.11;
/// Likelihoods below this are raised to it: no symbol takes more than 29.9 bits.
pub const LIKELIHOOD_BOUND: f32 = 1e-9;

/// A normal distribution for each value, all tensors of the same shape and in y units.
#[derive(Clone, Debug)]
pub struct NormalParameters<const D: usize> {
    /// Means.
    pub means: Tensor<D>,
    /// Standard deviations as given; values below [`SCALE_BOUND`] are raised to it when they are used.
    pub scales: Tensor<D>,
}

/// Probability of the unit interval around each value, at least [`LIKELIHOOD_BOUND`].
///
/// `values` are in y units and have the shape of the parameters. Scales may have any value: they are bounded below by
/// [`SCALE_BOUND`], with the gradient of [`lower_bound`](crate::ops::lower_bound::lower_bound).
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
    let bounds = NormalBounds { scale: SCALE_BOUND, likelihood: LIKELIHOOD_BOUND };
    normal_likelihood(values, means, scales, bounds)
}

/// Bits of a symbol of this likelihood, elementwise.
pub fn bits<const D: usize>(likelihood: Tensor<D>) -> Tensor<D> {
    likelihood.log() * -std::f64::consts::LOG2_E
}
