//! The fused Adam step: one pass over parameter, gradient and both moments.

use rayon::prelude::*;

use crate::ops::adam::AdamStep;

const CHUNK: usize = 1 << 14;

/// Updates `parameter`, `first` and `second` in place.
pub(crate) fn adam_step(
    parameter: &mut [f32],
    gradient: &[f32],
    first: &mut [f32],
    second: &mut [f32],
    step: AdamStep,
) {
    let AdamStep { learning_rate, beta_1, beta_2, epsilon, time } = step;
    // Bias corrections in f64: 1 - 0.999^t loses digits in f32.
    let correction_1 = 1.0 - f64::from(beta_1).powi(time as i32);
    let correction_2 = 1.0 - f64::from(beta_2).powi(time as i32);
    let step_size = (f64::from(learning_rate) / correction_1) as f32;
    let root_correction = correction_2.sqrt() as f32;
    parameter
        .par_chunks_mut(CHUNK)
        .zip(gradient.par_chunks(CHUNK))
        .zip(first.par_chunks_mut(CHUNK))
        .zip(second.par_chunks_mut(CHUNK))
        .for_each(|(((parameter, gradient), first), second)| {
            for i in 0..parameter.len() {
                let g = gradient[i];
                first[i] = beta_1 * first[i] + (1.0 - beta_1) * g;
                second[i] = beta_2 * second[i] + (1.0 - beta_2) * g * g;
                parameter[i] -= step_size * first[i] / (second[i].sqrt() / root_correction + epsilon);
            }
        });
}
