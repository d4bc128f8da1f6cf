//! The fused Adam step: one pass over parameter, gradient and both moments.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

use super::{AdamOps, AdamStep, AdamTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

const CHUNK: usize = 1 << 14;

/// Updates `parameter`, `first` and `second` in place.
fn adam_step_on_slices(parameter: &mut [f32], gradient: &[f32], first: &mut [f32], second: &mut [f32], step: AdamStep) {
    let AdamStep { beta_1, beta_2, epsilon, .. } = step;
    // In f64: 1 - 0.999 loses digits in f32.
    let (rest_1, rest_2) = ((1.0 - beta_1) as f32, (1.0 - beta_2) as f32);
    let (step_size, root_correction) = (step.corrected_learning_rate(), step.root_correction());
    let (beta_1, beta_2) = (beta_1 as f32, beta_2 as f32);
    parameter
        .par_chunks_mut(CHUNK)
        .zip(gradient.par_chunks(CHUNK))
        .zip(first.par_chunks_mut(CHUNK))
        .zip(second.par_chunks_mut(CHUNK))
        .for_each(|(((parameter, gradient), first), second)| {
            for i in 0..parameter.len() {
                let g = gradient[i];
                first[i] = beta_1 * first[i] + rest_1 * g;
                second[i] = beta_2 * second[i] + rest_2 * g * g;
                parameter[i] -= step_size * first[i] / (second[i].sqrt() / root_correction + epsilon);
            }
        });
}

fn adam_on_cpu<B: HostBackend>(tensors: AdamTensors<B>, gradient: FloatTensor<B>, step: AdamStep) -> AdamTensors<B> {
    debug_assert_eq!(tensors.parameter.shape(), gradient.shape());
    let mut parameter = B::to_host(tensors.parameter);
    let mut first = B::to_host(tensors.first_moment);
    let mut second = B::to_host(tensors.second_moment);
    let gradient = B::to_host(gradient);
    adam_step_on_slices(
        parameter.as_mut_slice(),
        gradient.as_slice(),
        first.as_mut_slice(),
        second.as_mut_slice(),
        step,
    );
    AdamTensors {
        parameter: B::from_host(parameter),
        first_moment: B::from_host(first),
        second_moment: B::from_host(second),
    }
}

for_cpu_back_ends! {
    AdamOps {
        fn adam(tensors: AdamTensors<Self>, gradient: FloatTensor<Self>, step: AdamStep) -> AdamTensors<Self> {
            adam_on_cpu(tensors, gradient, step)
        }
    }
}
