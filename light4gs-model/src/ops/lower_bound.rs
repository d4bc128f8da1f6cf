//! `max(x, bound)` whose gradient does not die below the bound (Ballé et al. 2018, as in CompressAI).
//!
//! The derivative of a maximum is zero below the bound, so what has once fallen below would never come back. Here a
//! gradient also passes there if a descent step along it increases x. That depends on the sign of the incoming
//! gradient, which no composition of ordinary operations can see; hence an operation of its own. It uses only the
//! back end's own operations, so it runs on every one of them.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    Autodiff, Backend, Dispatch, Flex, NdArray, TensorMetadata, backend_extension, get_or_init_device_settings,
};
use burn::tensor::Tensor;

/// The bound on every back end, with its own gradient under [`Autodiff`].
#[backend_extension(NdArray, Flex, Autodiff)]
pub trait LowerBoundOps: Backend {
    /// `max(tensor, bound)`, any shape.
    fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self>;
}

impl LowerBoundOps for NdArray {
    fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
        Self::float_clamp_min(tensor, bound.into())
    }
}

impl LowerBoundOps for Flex {
    fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
        Self::float_clamp_min(tensor, bound.into())
    }
}

/// The gradient where `tensor >= bound` or `gradient < 0`, else zero.
fn passed<B: Backend>(tensor: FloatTensor<B>, gradient: FloatTensor<B>, bound: f32) -> FloatTensor<B> {
    let bool_type = get_or_init_device_settings::<B>(&tensor.device()).bool_dtype;
    let below = B::float_lower_elem(tensor, bound.into(), bool_type);
    let decreasing = B::float_greater_equal_elem(gradient.clone(), 0f32.into(), bool_type);
    B::float_mask_fill(gradient, B::bool_and(below, decreasing), 0f32.into())
}

impl<B: LowerBoundOps, C: CheckpointStrategy> LowerBoundOps for Autodiff<B, C> {
    fn lower_bound(tensor: FloatTensor<Self>, bound: f32) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct LowerBound;

        impl<B: Backend> Backward<B, 1> for LowerBound {
            type State = (FloatTensor<B>, f32);

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                let gradient = grads.consume::<B>(&ops.node);
                let (tensor, bound) = ops.state;
                if let [Some(node)] = ops.parents {
                    grads.register::<B>(node.id, passed::<B>(tensor, gradient, bound));
                }
            }
        }

        let node = tensor.node();
        let tensor = tensor.into_primitive();
        let bounded = B::lower_bound(tensor.clone(), bound);
        match LowerBound.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((tensor, bound), bounded),
            OpsKind::UnTracked(prep) => prep.finish(bounded),
        }
    }
}

/// `max(tensor, bound)`; the gradient passes where `tensor >= bound`, and below it where it would increase the tensor.
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
