//! The gradients of a linear layer on a CPU.

use burn::backend::tensor::FloatTensor;

use super::{LinearKernels, backward, sums_over_rows};
use crate::ops::for_cpu_back_ends;

for_cpu_back_ends! {
    LinearKernels {
        fn linear_backward(
            input: FloatTensor<Self>,
            weight: FloatTensor<Self>,
            gradient: FloatTensor<Self>,
        ) -> [FloatTensor<Self>; 3] {
            backward::<Self>(input, weight, gradient, sums_over_rows::<Self>)
        }
    }
}
