//! The fused Adam step: one pass over parameter, gradient and both moments.

use rayon::prelude::*;

use super::{AdamOps, AdamStep, AdamTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};
use crate::ops::tensor_list::TensorList;

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

fn adam_on_cpu<B: HostBackend>(
    tensors: AdamTensors<B>,
    gradients: TensorList<B>,
    steps: Vec<AdamStep>,
) -> AdamTensors<B> {
    let hosts = |list: TensorList<B>| -> Vec<HostTensor> { list.0.into_iter().map(B::to_host).collect() };
    let mut parameters = hosts(tensors.parameters);
    let mut firsts = hosts(tensors.first_moments);
    let mut seconds = hosts(tensors.second_moments);
    let moments = firsts.iter_mut().zip(&mut seconds);
    for (((parameter, (first, second)), gradient), step) in
        parameters.iter_mut().zip(moments).zip(gradients.0).zip(steps)
    {
        let gradient = B::to_host(gradient);
        let [parameter, first, second] = [parameter, first, second].map(HostTensor::as_mut_slice);
        adam_step_on_slices(parameter, gradient.as_slice(), first, second, step);
    }
    let tensors = |hosts: Vec<HostTensor>| TensorList(hosts.into_iter().map(B::from_host).collect());
    AdamTensors { parameters: tensors(parameters), first_moments: tensors(firsts), second_moments: tensors(seconds) }
}

for_cpu_back_ends! {
    AdamOps {
        fn adam(
            tensors: AdamTensors<Self>,
            gradients: TensorList<Self>,
            steps: Vec<AdamStep>,
        ) -> AdamTensors<Self> {
            adam_on_cpu(tensors, gradients, steps)
        }
    }
}
