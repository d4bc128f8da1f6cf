//! The bits of symbols from their probabilities, which are raised to a bound first: one launch in place of three on a GPU, and one in
//! place of four for the gradient.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;

use super::recorded;

/// The gradient of a probability below the bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BelowBound {
    /// It passes where a descent step increases the probability, as that of [`lower_bound`](super::lower_bound::lower_bound).
    Rises,
    /// It is zero, as that of a maximum.
    Stays,
}

/// A back end's gradient. [`SymbolBitsOps`] adds the dispatch and the tape.
pub trait SymbolBitsKernels: Backend {
    /// Gradient of the probabilities from that of the bits.
    fn symbol_bits_backward(
        likelihoods: FloatTensor<Self>,
        bound: f32,
        below: BelowBound,
        upstream: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// The bits on every back end that has [`SymbolBitsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait SymbolBitsOps: Backend {
    /// Elementwise; see [`symbol_bits`].
    fn symbol_bits(likelihoods: FloatTensor<Self>, bound: f32, below: BelowBound) -> FloatTensor<Self>;
}

impl<B: SymbolBitsOps + SymbolBitsKernels, C: CheckpointStrategy> SymbolBitsOps for Autodiff<B, C> {
    fn symbol_bits(likelihoods: FloatTensor<Self>, bound: f32, below: BelowBound) -> FloatTensor<Self> {
        let node = likelihoods.node();
        let likelihoods = likelihoods.into_primitive();
        let bits = B::symbol_bits(likelihoods.clone(), bound, below);
        recorded::<B, C, _, _>([node], (bits, (likelihoods, bound, below)), |(likelihoods, bound, below), gradient| {
            [B::symbol_bits_backward(likelihoods, bound, below, gradient)]
        })
    }
}

/// `-log2(max(likelihoods, bound))`, of any shape.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::symbol_bits::{BelowBound, symbol_bits};
///
/// let device = Device::flex().autodiff();
/// let likelihoods = Tensor::<1>::from_floats([0.25, 0.01], &device).require_grad();
/// let bits = symbol_bits(likelihoods.clone(), 0.125, BelowBound::Stays);
/// assert_eq!(bits.clone().into_data().to_vec::<f32>().unwrap(), [2.0, 3.0]);
/// let gradient = likelihoods.grad(&bits.sum().backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [-4.0 * std::f32::consts::LOG2_E, 0.0]);
/// ```
pub fn symbol_bits<const D: usize>(likelihoods: Tensor<D>, bound: f32, below: BelowBound) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::symbol_bits(likelihoods.into_dispatch(), bound, below))
}
