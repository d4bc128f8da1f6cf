//! The activations of attributes on a CPU: Burn's own operations, composed.

use burn::backend::TensorMetadata;
use burn::backend::get_or_init_device_settings;
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use light4gs_codec::rendering::MAX_LOGARITHM;

use super::{ActivationKernels, ActivationOps, Curve, bound_reached};
use crate::ops::for_cpu_back_ends;

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
