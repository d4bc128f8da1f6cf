//! The logistic function: one kernel on a GPU in each direction, where Burn's own, a composition, takes eight and ten.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
#[cfg(feature = "wgpu")]
use burn_wgpu::CubeBackend;

#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::{differentiate, for_cpu_back_ends};
#[cfg(feature = "wgpu")]
use crate::gpu::{sigmoid_backward_on_gpu, sigmoid_on_gpu};

/// A back end's gradient. [`SigmoidOps`] adds the dispatch and the tape.
pub trait SigmoidKernels: Backend {
    /// The upstream gradient times the slope where the function has these values.
    fn logistic_backward(values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The function on every back end that has [`SigmoidKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait SigmoidOps: Backend {
    /// Elementwise, any shape. Named apart from Burn's own operation.
    fn logistic(tensor: FloatTensor<Self>) -> FloatTensor<Self>;
}

for_cpu_back_ends! {
    SigmoidOps {
        fn logistic(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
            Self::float_recip(Self::float_add_scalar(Self::float_exp(Self::float_neg(tensor)), 1.0.into()))
        }
    }
}

for_cpu_back_ends! {
    SigmoidKernels {
        fn logistic_backward(values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
            let rest = Self::float_add_scalar(Self::float_neg(values.clone()), 1.0.into());
            Self::float_mul(upstream, Self::float_mul(values, rest))
        }
    }
}

#[cfg(feature = "wgpu")]
impl SigmoidOps for CubeBackend {
    fn logistic(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        sigmoid_on_gpu(tensor)
    }
}

#[cfg(feature = "wgpu")]
impl SigmoidKernels for CubeBackend {
    fn logistic_backward(values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        sigmoid_backward_on_gpu(values, upstream)
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + SigmoidOps> SigmoidOps for Fusion<B> {
    fn logistic(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::logistic(resolve::<B>(tensor)))
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + SigmoidKernels> SigmoidKernels for Fusion<B> {
    fn logistic_backward(values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::logistic_backward(resolve::<B>(values), resolve::<B>(upstream)))
    }
}

impl<B: SigmoidOps + SigmoidKernels, C: CheckpointStrategy> SigmoidOps for Autodiff<B, C> {
    fn logistic(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Sigmoid;

        impl<B: SigmoidKernels> Backward<B, 1> for Sigmoid {
            type State = FloatTensor<B>;

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |values, gradient| [B::logistic_backward(values, gradient)]);
            }
        }

        let node = tensor.node();
        let values = B::logistic(tensor.into_primitive());
        match Sigmoid.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(values.clone(), values),
            OpsKind::UnTracked(prep) => prep.finish(values),
        }
    }
}

/// `1 / (1 + exp(-x))`, elementwise.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::sigmoid::sigmoid;
///
/// let device = Device::flex().autodiff();
/// let x = Tensor::<1>::from_floats([0.0, 100.0, -100.0], &device).require_grad();
/// let y = sigmoid(x.clone());
/// assert_eq!(y.clone().into_data().to_vec::<f32>().unwrap()[..2], [0.5, 1.0]);
/// assert_eq!(x.grad(&y.sum().backward()).unwrap().into_data().to_vec::<f32>().unwrap()[..2], [0.25, 0.0]);
/// ```
pub fn sigmoid<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    Tensor::from_dispatch(Dispatch::logistic(tensor.into_dispatch()))
}
