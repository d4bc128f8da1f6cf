//! `max(x, bound)` with a gradient below the bound too (Ballé et al. 2018, as in CompressAI).
//!
//! The derivative of a maximum is zero below the bound, so a value that has once fallen below would never rise again.
//! Here the gradient also passes below the bound if a descent step increases x. That depends on the sign of the
//! incoming gradient, which no composition of ordinary operations can express; so it is a custom operation.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension, get_or_init_device_settings};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// A back end's gradient. [`LowerBoundOps`] adds the dispatch and the tape.
pub trait LowerBoundKernels: Backend {
    /// The upstream gradient where `tensor >= bound` or the gradient is negative, else zero.
    fn lower_bound_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>, bound: f32) -> FloatTensor<Self>;
}

/// The bound on every back end that has [`LowerBoundKernels`], with its own gradient under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait LowerBoundOps: Backend {
    /// `max(tensor, bound)`, any shape.
    fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self>;
}

for_all_back_ends! {
    LowerBoundOps with LowerBoundKernels {
        fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
            Self::float_clamp_min(tensor, bound.into())
        }
    }
}

fn masked_gradient<B: Backend>(tensor: FloatTensor<B>, upstream: FloatTensor<B>, bound: f32) -> FloatTensor<B> {
    let bool_type = get_or_init_device_settings::<B>(&tensor.device()).bool_dtype;
    let below = B::float_lower_elem(tensor, bound.into(), bool_type);
    let decreasing = B::float_greater_equal_elem(upstream.clone(), 0f32.into(), bool_type);
    B::float_mask_fill(upstream, B::bool_and(below, decreasing), 0f32.into())
}

impl<B: LowerBoundOps + LowerBoundKernels, C: CheckpointStrategy> LowerBoundOps for Autodiff<B, C> {
    fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
        let node = tensor.node();
        let tensor = tensor.into_primitive();
        let bounded = B::lower_bound(tensor.clone(), bound);
        recorded::<B, C, _, _>([node], (bounded, (tensor, bound)), |(tensor, bound), gradient| {
            [B::lower_bound_backward(tensor, gradient, bound)]
        })
    }
}

/// `max(tensor, bound)`. The gradient passes where `tensor >= bound`; below the bound it passes if a descent step
/// increases the tensor.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::lower_bound::lower_bound;
///
/// let device = Device::flex().autodiff();
/// let x = Tensor::<1>::from_floats([0.5, 0.1, 0.1], &device).require_grad();
/// let bounded = lower_bound(x.clone(), 0.2);
/// // Descent raises the second element and lowers the third, which is below the bound already.
/// let loss = (bounded.clone() * Tensor::from_floats([1.0, -1.0, 1.0], &device)).sum();
/// let gradient = x.grad(&loss.backward()).unwrap();
/// assert_eq!(bounded.into_data().to_vec::<f32>().unwrap(), [0.5, 0.2, 0.2]);
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [1.0, -1.0, 0.0]);
/// ```
pub fn lower_bound<const D: usize>(tensor: Tensor<D>, bound: f32) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::lower_bound(tensor.into_dispatch(), bound))
}
