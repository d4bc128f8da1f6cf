//! The standard normal distribution function, with a relative error of about 1e-6 far into its lower tail.
//!
//! `(1 + erf(x / sqrt 2)) / 2` has no correct digit below -5, where an entropy model still needs the probability of an
//! interval and its logarithm. Chebyshev's fit of `erfc` (Press et al., Numerical Recipes, section 6.2) has a
//! *relative* error of 1.2e-7 everywhere.

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

use super::for_cpu_back_ends;
#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
#[cfg(feature = "wgpu")]
use crate::gpu::{normal_cdf_backward_on_gpu, normal_cdf_on_gpu};

/// Coefficients of `ln(erfc(z) / t) + z²` in `t = 1 / (1 + z / 2)`, lowest power first.
/// `shaders/elementwise/normal_cdf.wgsl` has the same.
const COEFFICIENTS: [f64; 10] = [
    -1.26551223,
    1.00002368,
    0.37409196,
    0.09678418,
    -0.18628806,
    0.27886807,
    -1.13520398,
    1.48851587,
    -0.82215223,
    0.17087277,
];

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

for_cpu_back_ends! {
    NormalCdfOps {
        fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
            distribution::<Self>(tensor)
        }
    }
}

for_cpu_back_ends! {
    NormalCdfKernels {
        fn normal_cdf_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
            Self::float_mul(upstream, density::<Self>(tensor))
        }
    }
}

#[cfg(feature = "wgpu")]
impl NormalCdfOps for CubeBackend {
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        normal_cdf_on_gpu(tensor)
    }
}

#[cfg(feature = "wgpu")]
impl NormalCdfKernels for CubeBackend {
    fn normal_cdf_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        normal_cdf_backward_on_gpu(tensor, upstream)
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + NormalCdfOps> NormalCdfOps for Fusion<B> {
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::normal_cdf(resolve::<B>(tensor)))
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + NormalCdfKernels> NormalCdfKernels for Fusion<B> {
    fn normal_cdf_backward(tensor: FloatTensor<Self>, upstream: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::normal_cdf_backward(resolve::<B>(tensor), resolve::<B>(upstream)))
    }
}

fn distribution<B: Backend>(x: FloatTensor<B>) -> FloatTensor<B> {
    let bool_type = get_or_init_device_settings::<B>(&x.device()).bool_dtype;
    let upper = B::float_greater_equal_elem(x.clone(), 0f32.into(), bool_type);
    let squared = B::float_mul_scalar(B::float_mul(x.clone(), x.clone()), (-0.5).into());
    let half_z = B::float_mul_scalar(B::float_abs(x), (std::f64::consts::FRAC_1_SQRT_2 / 2.0).into());
    let t = B::float_recip(B::float_add_scalar(half_z, 1.0.into()));
    let (highest, rest) = COEFFICIENTS.split_last().expect("ten coefficients");
    let start = B::float_mul_scalar(t.clone(), (*highest).into());
    let polynomial = rest
        .iter()
        .skip(1)
        .rev()
        .fold(start, |sum, coefficient| B::float_mul(B::float_add_scalar(sum, (*coefficient).into()), t.clone()));
    let exponent = B::float_add(B::float_add_scalar(polynomial, rest[0].into()), squared);
    let lower_tail = B::float_mul_scalar(B::float_mul(t, B::float_exp(exponent)), 0.5.into());
    let upper_side = B::float_add_scalar(B::float_neg(lower_tail.clone()), 1.0.into());
    B::float_mask_where(lower_tail, upper, upper_side)
}

/// The standard normal density.
fn density<B: Backend>(x: FloatTensor<B>) -> FloatTensor<B> {
    let exponent = B::float_mul_scalar(B::float_mul(x.clone(), x), (-0.5).into());
    let normalizer = 1.0 / std::f64::consts::TAU.sqrt();
    B::float_mul_scalar(B::float_exp(exponent), normalizer.into())
}

impl<B: NormalCdfOps + NormalCdfKernels, C: CheckpointStrategy> NormalCdfOps for Autodiff<B, C> {
    fn normal_cdf(tensor: FloatTensor<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct NormalCdf;

        impl<B: NormalCdfKernels> Backward<B, 1> for NormalCdf {
            type State = FloatTensor<B>;

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                let gradient = grads.consume::<B>(&ops.node);
                if let [Some(node)] = ops.parents {
                    grads.register::<B>(node.id, B::normal_cdf_backward(ops.state, gradient));
                }
            }
        }

        let node = tensor.node();
        let tensor = tensor.into_primitive();
        let values = B::normal_cdf(tensor.clone());
        match NormalCdf.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(tensor, values),
            OpsKind::UnTracked(prep) => prep.finish(values),
        }
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
