//! The standard normal distribution function, with a relative error of about 1e-6 far into its lower tail.
//!
//! `(1 + erf(x / sqrt 2)) / 2` has no correct digit below -5, where an entropy model still needs the probability of an
//! interval and its logarithm. Chebyshev's fit of `erfc` (Press et al., Numerical Recipes, section 6.2) has a
//! *relative* error of 1.2e-7 everywhere.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

use super::recorded;

/// A back end's gradient. [`NormalCdfOps`] adds the dispatch and the tape.
pub trait NormalCdfKernels: Backend {
    /// The upstream gradient times the density at `tensor`.
    fn normal_cdf_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The function on every back end that has [`NormalCdfKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NormalCdfOps: Backend {
    /// Elementwise, any shape.
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self>;
}

impl<B: NormalCdfOps + NormalCdfKernels, C: CheckpointStrategy> NormalCdfOps for Autodiff<B, C> {
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        let node = tensor.node();
        let tensor = tensor.into_primitive();
        let values = B::normal_cdf(tensor.clone());
        recorded::<B, C, _, _>([node], (values, tensor), |tensor, gradient| [B::normal_cdf_backward(tensor, gradient)])
    }
}

/// Probability that a standard normal variable is below each element.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::normal_cdf::normal_cdf;
///
/// let x = Tensor::<1>::from_floats([0.0, 1.0, -6.0], &Device::flex());
/// let p = normal_cdf(x).into_data().to_vec::<f32>().unwrap();
/// assert!((p[0] - 0.5).abs() < 2e-7 && (p[1] - 0.841_344_7).abs() < 2e-7);
/// assert!((p[2] / 9.865_876e-10 - 1.0).abs() < 1e-5);
/// ```
pub fn normal_cdf<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::normal_cdf(tensor.into_dispatch()))
}
