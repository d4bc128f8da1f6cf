//! The fused Adam step: one pass over parameter, gradient and both moments.

use rayon::prelude::*;

use crate::kernels::adam::AdamStep;

const CHUNK: usize = 1 << 14;

/// Updates `parameter`, `first` and `second` in place.
pub(crate) fn adam_step(
    parameter: &mut [f32],
    gradient: &[f32],
    first: &mut [f32],
    second: &mut [f32],
    step: AdamStep,
) {
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
