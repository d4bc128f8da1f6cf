//! The standard normal distribution function on a CPU: Burn's own operations, composed.

use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata, get_or_init_device_settings};

use super::{NormalCdfKernels, NormalCdfOps};
use crate::ops::for_cpu_back_ends;

/// Coefficients of `ln(erfc(z) / t) + z²` in `t = 1 / (1 + z / 2)`, lowest power first.
/// `shaders/normal_cdf/normal_cdf.wgsl` has the same.
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
