//! The activations of attributes of Gaussians, as Burn operations: one kernel on a GPU in each direction, where compositions of Burn's
//! own operations take three to ten.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
use light4gs_codec::rendering::MAX_LOGARITHM;

use super::recorded;

/// A function of one number.
#[derive(Clone, Copy, Debug)]
pub enum Curve {
    /// `1 / (1 + exp(-x))`.
    Sigmoid,
    /// `exp(min(x, MAX_LOGARITHM))`.
    BoundedExponential,
}

/// A bounded exponential from here on has reached its bound. A little below it, since no two compilers have the same last digit.
pub(super) fn bound_reached() -> f32 {
    0.999 * MAX_LOGARITHM.exp()
}

/// A back end's gradient. [`ActivationOps`] adds the dispatch and the tape.
pub trait ActivationKernels: Backend {
    /// The upstream gradient times the slope where the function has these values.
    fn activation_backward(curve: Curve, values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The function on every back end that has [`ActivationKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait ActivationOps: Backend {
    /// Elementwise, any shape.
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self>;
}

impl<B: ActivationOps + ActivationKernels, C: CheckpointStrategy> ActivationOps for Autodiff<B, C> {
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        let node = tensor.node();
        let values = B::activation(curve, tensor.into_primitive());
        recorded::<B, C, _, _>([node], (values.clone(), (curve, values)), |(curve, values), gradient| {
            [B::activation_backward(curve, values, gradient)]
        })
    }
}

/// `1 / (1 + exp(-x))`, elementwise.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::activation::sigmoid;
///
/// let device = Device::flex().autodiff();
/// let x = Tensor::<1>::from_floats([0.0, 100.0, -100.0], &device).require_grad();
/// let y = sigmoid(x.clone());
/// assert_eq!(y.clone().into_data().to_vec::<f32>().unwrap()[..2], [0.5, 1.0]);
/// assert_eq!(x.grad(&y.sum().backward()).unwrap().into_data().to_vec::<f32>().unwrap()[..2], [0.25, 0.0]);
/// ```
pub fn sigmoid<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::activation(Curve::Sigmoid, tensor.into_dispatch()))
}

/// `exp(min(x, MAX_LOGARITHM))`, elementwise: finite for every number, so that a backward pass has no 0 · infinity. The slope is 0
/// where `x` is beyond [`MAX_LOGARITHM`], or less than 0.001 below it.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::activation::bounded_exponential;
///
/// let device = Device::flex().autodiff();
/// let x = Tensor::<1>::from_floats([0.0, 1e9], &device).require_grad();
/// let y = bounded_exponential(x.clone());
/// assert!(y.clone().into_data().to_vec::<f32>().unwrap()[1].is_finite());
/// assert_eq!(x.grad(&y.sum().backward()).unwrap().into_data().to_vec::<f32>().unwrap(), [1.0, 0.0]);
/// ```
pub fn bounded_exponential<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::activation(Curve::BoundedExponential, tensor.into_dispatch()))
}
