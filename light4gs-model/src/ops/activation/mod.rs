//! What attributes of Gaussians go through before they are drawn: one kernel on a GPU in each direction, where Burn's own operations,
//! compositions, take three to ten.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension, get_or_init_device_settings};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
#[cfg(feature = "wgpu")]
use burn_wgpu::CubeBackend;
use light4gs_codec::rendering::MAX_LOGARITHM;

#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::{differentiate, for_cpu_back_ends};
#[cfg(feature = "wgpu")]
use crate::gpu::{activation_backward_on_gpu, activation_on_gpu};
pub use crate::kernels::activation::Curve;
use crate::kernels::activation::bound_reached;

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

for_cpu_back_ends! {
    ActivationOps {
        fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
            match curve {
                Curve::Sigmoid => {
                    Self::float_recip(Self::float_add_scalar(Self::float_exp(Self::float_neg(tensor)), 1.0.into()))
                }
                Curve::BoundedExponential => Self::float_exp(Self::float_clamp_max(tensor, MAX_LOGARITHM.into())),
            }
        }
    }
}

for_cpu_back_ends! {
    ActivationKernels {
        fn activation_backward(
            curve: Curve,
            values: FloatTensor<Self>,
            upstream: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            match curve {
                Curve::Sigmoid => {
                    let rest = Self::float_add_scalar(Self::float_neg(values.clone()), 1.0.into());
                    Self::float_mul(upstream, Self::float_mul(values, rest))
                }
                Curve::BoundedExponential => {
                    let bool_type = get_or_init_device_settings::<Self>(&values.device()).bool_dtype;
                    let bounded = Self::float_greater_equal_elem(values.clone(), bound_reached().into(), bool_type);
                    Self::float_mask_fill(Self::float_mul(upstream, values), bounded, 0.0.into())
                }
            }
        }
    }
}

#[cfg(feature = "wgpu")]
impl ActivationOps for CubeBackend {
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        activation_on_gpu(curve, tensor)
    }
}

#[cfg(feature = "wgpu")]
impl ActivationKernels for CubeBackend {
    fn activation_backward(curve: Curve, values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        activation_backward_on_gpu(curve, values, upstream)
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + ActivationOps> ActivationOps for Fusion<B> {
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::activation(curve, resolve::<B>(tensor)))
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + ActivationKernels> ActivationKernels for Fusion<B> {
    fn activation_backward(curve: Curve, values: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::activation_backward(curve, resolve::<B>(values), resolve::<B>(upstream)))
    }
}

impl<B: ActivationOps + ActivationKernels, C: CheckpointStrategy> ActivationOps for Autodiff<B, C> {
    fn activation(curve: Curve, tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Activated;

        impl<B: ActivationKernels> Backward<B, 1> for Activated {
            type State = (Curve, FloatTensor<B>);

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |(curve, values), gradient| {
                    [B::activation_backward(curve, values, gradient)]
                });
            }
        }

        let node = tensor.node();
        let values = B::activation(curve, tensor.into_primitive());
        match Activated.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((curve, values.clone()), values),
            OpsKind::UnTracked(prep) => prep.finish(values),
        }
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
