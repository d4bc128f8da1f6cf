//! Learning-rate schedules.

use std::f64::consts::FRAC_PI_2;

/// Log-linear decay from one rate to another, with an optional slow start (as in the original 3DGS code).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExponentialDecay {
    /// Rate at step 0.
    pub initial: f64,
    /// Rate from `steps` on.
    pub last: f64,
    /// Steps of the slow start; 0 = none.
    pub delay_steps: f64,
    /// Factor at step 0 of the slow start, which rises to 1 along a quarter sine.
    pub delay_factor: f64,
    /// Length of the decay.
    pub steps: f64,
}

impl ExponentialDecay {
    /// A decay without slow start.
    pub fn new(initial: f64, last: f64, steps: usize) -> Self {
        Self { initial, last, delay_steps: 0.0, delay_factor: 1.0, steps: steps as f64 }
    }

    /// The rate at a step; 0 where both ends are 0 or the step is negative.
    pub fn at(&self, step: f64) -> f64 {
        if step < 0.0 || (self.initial == 0.0 && self.last == 0.0) {
            return 0.0;
        }
        let delay = if self.delay_steps > 0.0 {
            let progress = (step / self.delay_steps).clamp(0.0, 1.0);
            self.delay_factor + (1.0 - self.delay_factor) * (FRAC_PI_2 * progress).sin()
        } else {
            1.0
        };
        let progress = (step / self.steps).clamp(0.0, 1.0);
        delay * (self.initial.ln() * (1.0 - progress) + self.last.ln() * progress).exp()
    }
}
