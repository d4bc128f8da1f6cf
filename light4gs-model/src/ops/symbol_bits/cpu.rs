//! The bits of symbols on a CPU: Burn's own operations, composed.

use std::f64::consts::LOG2_E;

use burn::backend::TensorMetadata;
use burn::backend::get_or_init_device_settings;
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;

use super::{BelowBound, SymbolBitsKernels, SymbolBitsOps};
use crate::ops::for_cpu_back_ends;
use crate::ops::lower_bound::LowerBoundKernels;

for_cpu_back_ends! {
    SymbolBitsOps {
        fn symbol_bits(likelihoods: FloatTensor<Self>, bound: f32, _: BelowBound) -> FloatTensor<Self> {
            let raised = Self::float_clamp_min(likelihoods, bound.into());
            Self::float_mul_scalar(Self::float_log(raised), (-LOG2_E).into())
        }
    }
}

for_cpu_back_ends! {
    SymbolBitsKernels {
        fn symbol_bits_backward(
            likelihoods: FloatTensor<Self>,
            bound: f32,
            below: BelowBound,
            upstream: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            let raised = Self::float_clamp_min(likelihoods.clone(), bound.into());
            let gradient = Self::float_div(Self::float_mul_scalar(upstream, (-LOG2_E).into()), raised);
            match below {
                BelowBound::Rises => Self::lower_bound_backward(likelihoods, gradient, bound),
                BelowBound::Stays => {
                    let bool_type = get_or_init_device_settings::<Self>(&likelihoods.device()).bool_dtype;
                    let lower = Self::float_lower_elem(likelihoods, bound.into(), bool_type);
                    Self::float_mask_fill(gradient, lower, 0.0.into())
                }
            }
        }
    }
}
