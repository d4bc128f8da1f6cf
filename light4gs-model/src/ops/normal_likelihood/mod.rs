//! Probabilities of unit intervals under normal distributions, or their bits, as a Burn operation: one pass over the values in place of some
//! twenty, with a relative error of about 1e-6 far into the tails.
//!
//! `(1 + erf(x / sqrt 2)) / 2` has no correct digit below -5, where an entropy model still needs the probability of an
//! interval and its logarithm. Chebyshev's fit of `erfc` (Press et al., Numerical Recipes, section 6.2) has a
//! *relative* error of 1.2e-7 everywhere.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::recorded;

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
#[derive(Clone, Debug, ExtensionType)]
pub struct NormalTensors<B: Backend> {
    /// The middles of the intervals, `[C, ...]`.
    pub values: FloatTensor<B>,
    /// `[2 C, ...]`: standard deviations, before their bound, then means.
    pub parameters: FloatTensor<B>,
}

impl<B: Backend> NormalTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; 2] {
        [self.values, self.parameters]
    }

    fn from_array([values, parameters]: [FloatTensor<B>; 2]) -> Self {
        Self { values, parameters }
    }
}

/// What small numbers are raised to, each with the gradient of [`lower_bound`](super::lower_bound::lower_bound).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalBounds {
    /// Of the standard deviations.
    pub scale: f32,
    /// Of the probabilities.
    pub likelihood: f32,
}

/// What is computed of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Its probability.
    Likelihood,
    /// The bits of a symbol of that probability.
    Bits,
}

/// A back end's gradients. [`NormalLikelihoodOps`] adds the dispatch and the tape.
pub trait NormalLikelihoodKernels: Backend {
    /// Gradients of the inputs from that of the measure.
    fn normal_likelihood_backward(
        tensors: NormalTensors<Self>,
        bounds: NormalBounds,
        measure: Measure,
        upstream: FloatTensor<Self>,
    ) -> NormalTensors<Self>;
}

/// The probabilities on every back end that has [`NormalLikelihoodKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NormalLikelihoodOps: Backend {
    /// Elementwise; see [`normal_likelihood`] and [`normal_bits`].
    fn normal_likelihood(
        #[extension_type] tensors: NormalTensors<Self>,
        bounds: NormalBounds,
        measure: Measure,
    ) -> FloatTensor<Self>;
}

impl<B: NormalLikelihoodOps + NormalLikelihoodKernels, C: CheckpointStrategy> NormalLikelihoodOps for Autodiff<B, C> {
    fn normal_likelihood(tensors: NormalTensors<Self>, bounds: NormalBounds, measure: Measure) -> FloatTensor<Self> {
        let tensors = tensors.into_array();
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let inner = NormalTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let measured = B::normal_likelihood(inner.clone(), bounds, measure);
        let saved = (inner, bounds, measure);
        recorded::<B, C, _, _>(nodes, (measured, saved), |(inner, bounds, measure), gradient| {
            B::normal_likelihood_backward(inner, bounds, measure, gradient).into_array()
        })
    }
}

/// Probability of the interval of length 1 around each of `values [C, ...]` under its normal distribution. `parameters [2 C, ...]` are
/// the standard deviations, then the means. Standard deviations and probabilities are raised to the bounds.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::normal_likelihood::{NormalBounds, normal_likelihood};
///
/// let row = |row: &[f32]| Tensor::<1>::from_floats(row, &Device::flex());
/// let bounds = NormalBounds { scale: 0.11, likelihood: 1e-12 };
/// // Two standard deviations, two means.
/// let likelihoods = normal_likelihood(row(&[0.0, 6.5]), row(&[1.0, 1.0, 0.0, 0.0]), bounds);
/// let p = likelihoods.into_data().to_vec::<f32>().unwrap();
/// assert!((p[0] - 0.382_924_9).abs() < 1e-6);
/// // The interval from 6 to 7.
/// assert!((p[1] / 9.853_079e-10 - 1.0).abs() < 1e-5);
/// ```
///
/// # Panics
/// If the shapes do not belong together.
pub fn normal_likelihood<const D: usize>(values: Tensor<D>, parameters: Tensor<D>, bounds: NormalBounds) -> Tensor<D> {
    measured(values, parameters, bounds, Measure::Likelihood)
}

/// `-log2` of [`normal_likelihood`].
///
/// # Panics
/// If the shapes do not belong together.
pub fn normal_bits<const D: usize>(values: Tensor<D>, parameters: Tensor<D>, bounds: NormalBounds) -> Tensor<D> {
    measured(values, parameters, bounds, Measure::Bits)
}

fn measured<const D: usize>(
    values: Tensor<D>,
    parameters: Tensor<D>,
    bounds: NormalBounds,
    measure: Measure,
) -> Tensor<D> {
    let mut twice = values.dims();
    twice[0] *= 2;
    assert_eq!(parameters.dims(), twice, "a standard deviation and a mean for each value");
    Tensor::from_dispatch(Dispatch::normal_likelihood(
        NormalTensors { values: values.into_dispatch(), parameters: parameters.into_dispatch() },
        bounds,
        measure,
    ))
}
