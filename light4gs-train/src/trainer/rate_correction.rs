//! Corrects the expected bits of each attribute by those that the coder writes.

use light4gs_codec::Encoded;
use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::EntropyModels;

/// Corrections per fine stage: the period is its iterations divided by this. The last iteration has none, since nothing is
/// trained after it.
pub(crate) const CORRECTIONS: usize = 12;
/// Further corrections in the last period, each after half of what is left. The bits of few symbols, as those of opacity,
/// drift by up to 4 % in a whole period, and a file has to be as large as training expects.
const LAST_CORRECTIONS: u32 = 3;

/// Whether a correction is due after an iteration of a fine stage, `iterations` long.
pub(crate) fn is_due(iteration: usize, iterations: usize) -> bool {
    let period = (iterations / CORRECTIONS).max(1);
    let left = iterations.saturating_sub(iteration);
    let is_last = |halvings: u32| left == period >> halvings;
    left > 0 && (iteration.is_multiple_of(period) || (1..=LAST_CORRECTIONS).any(is_last))
}

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Whether a correction is due: from the end of densification on, where attributes have a model.
    pub(super) fn correction_is_due(&self, iteration: usize) -> bool {
        let models_attributes = self.state.compression.as_ref().is_some_and(|models| models.attributes.is_some());
        models_attributes
            && is_due(iteration, self.config.train.fine_iterations)
            && self.gaussian_rate_is_active(iteration)
    }

    /// Corrects the expected bits by those in the scene's file.
    pub(super) fn correct_expected_bits(&mut self, file: &Encoded) {
        if let Some(compression) = &mut self.state.compression {
            compression.correct_expected_bits(file, &self.device);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrections_are_denser_at_the_end() {
        let all = |iterations| (1..=iterations).filter(|k| is_due(*k, iterations)).collect::<Vec<_>>();
        let mut expected: Vec<usize> = (1..12).map(|k| 1000 * k).collect();
        expected.extend([11_500, 11_750, 11_875]);
        assert_eq!(all(12_000), expected);
        assert_eq!(all(3), [1, 2]);
        assert!(all(0).is_empty());
    }
}
