//! The gradient of the logarithms of noise's widths on a CPU, by Burn's operations.

use burn::backend::tensor::FloatTensor;

use super::{NoiseGradientOps, NoisyTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

for_cpu_back_ends! {
    NoiseGradientOps {
        fn noise_gradient(tensors: NoisyTensors<Self>, places: Vec<usize>, count: usize) -> FloatTensor<Self> {
            use burn::backend::ops::FloatTensorOps;

            let NoisyTensors { noisy, exact, gradients } = tensors;
            let mut sums = vec![0.0; count];
            for (((noisy, exact), gradient), place) in noisy.0.into_iter().zip(exact.0).zip(gradients.0).zip(places) {
                let products = Self::float_mul(Self::float_sub(noisy, exact), gradient);
                sums[place] = Self::to_host(Self::float_sum(products)).as_slice()[0];
            }
            Self::from_values(sums, [count])
        }
    }
}
