//! The Gaussian conditional entropy model (Minnen et al. 2018, as in CompressAI; docs/design.md).
//!
//! Everything is in *y units*: a value divided by its quantization step, so that a symbol's interval has length 1.

use burn::tensor::Tensor;

use crate::ops::normal_likelihood::{NormalBounds, normal_bits, normal_likelihood};
use crate::ops::symbol_bits::{BelowBound, symbol_bits};

/// Standard deviations below this are raised to it.
pub const SCALE_BOUND: f32 = 0.11;
/// Likelihoods below this are raised to it: no symbol takes more than 29.9 bits.
pub const LIKELIHOOD_BOUND: f32 = 1e-9;
const BOUNDS: NormalBounds = NormalBounds { scale: SCALE_BOUND, likelihood: LIKELIHOOD_BOUND };

/// A normal distribution for each value, in y units.
#[derive(Clone, Debug)]
pub struct NormalParameters<const D: usize>(Tensor<D>);

impl<const D: usize> NormalParameters<D> {
    /// From means and standard deviations of the values' shape. Standard deviations below [`SCALE_BOUND`] are raised to it when they
    /// are used.
    pub fn new(means: Tensor<D>, scales: Tensor<D>) -> Self {
        Self(Tensor::cat(vec![scales, means], 0))
    }

    /// From the output of a network: the standard deviations of all values, then their means, along the first axis.
    ///
    /// # Panics
    /// If the first axis has an odd length.
    pub fn of_network(output: Tensor<D>) -> Self {
        let length = output.dims()[0];
        assert!(length.is_multiple_of(2), "as many standard deviations as means, not {length} numbers");
        Self(output)
    }

    /// Means, of the values' shape.
    pub fn means(&self) -> Tensor<D> {
        self.0.clone().narrow(0, self.0.dims()[0] / 2, self.0.dims()[0] / 2)
    }

    /// Standard deviations as given, of the values' shape.
    pub fn scales(&self) -> Tensor<D> {
        self.0.clone().narrow(0, 0, self.0.dims()[0] / 2)
    }
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
/// let p = gaussian_likelihood(value, NormalParameters::new(means, scales)).into_scalar::<f32>();
/// assert!((p - 0.382_924_9).abs() < 1e-6);
/// ```
pub fn gaussian_likelihood<const D: usize>(values: Tensor<D>, parameters: NormalParameters<D>) -> Tensor<D> {
    normal_likelihood(values, parameters.0, BOUNDS)
}

/// Bits of the symbol of each value: those of [`gaussian_likelihood`], in one pass.
pub fn gaussian_bits<const D: usize>(values: Tensor<D>, parameters: NormalParameters<D>) -> Tensor<D> {
    normal_bits(values, parameters.0, BOUNDS)
}

/// Bits of a symbol of this likelihood, elementwise. Likelihoods below [`LIKELIHOOD_BOUND`] are raised to it, with the gradient of
/// [`lower_bound`](crate::ops::lower_bound::lower_bound).
pub fn bits<const D: usize>(likelihood: Tensor<D>) -> Tensor<D> {
    symbol_bits(likelihood, LIKELIHOOD_BOUND, BelowBound::Rises)
}
