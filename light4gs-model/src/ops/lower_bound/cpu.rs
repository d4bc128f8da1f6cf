//! The gradient of a lower bound on a CPU.

use burn::backend::tensor::FloatTensor;

use super::{LowerBoundKernels, masked_gradient};
use crate::ops::for_cpu_back_ends;

for_cpu_back_ends! {
    LowerBoundKernels {
        fn lower_bound_backward(
            tensor: FloatTensor<Self>,
            upstream: FloatTensor<Self>,
            bound: f32,
        ) -> FloatTensor<Self> {
            masked_gradient::<Self>(tensor, upstream, bound)
        }
    }
}
