//! The bits that are expected of each attribute follow those that the coder writes.

use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::EntropyModels;
use crate::dataset::scene_meta;

/// The fine stage has so many iterations between two corrections that there would be this many of them in all of it. The
/// last iteration has none: nothing is trained after it.
pub(crate) const CORRECTIONS: usize = 12;
/// Further ones in the last of these periods, each after half of what is left. The bits of few symbols, as those of opacity,
/// drift by up to 4 % in a whole period, and a file has to be as large as training expects.
const LAST_CORRECTIONS: u32 = 3;

/// Whether a correction is due after an iteration of a fine stage with so many.
pub(crate) fn is_due(iteration: usize, iterations: usize) -> bool {
    let period = (iterations / CORRECTIONS).max(1);
    let left = iterations.saturating_sub(iteration);
    let is_last = |halvings: u32| left == period >> halvings;
    left > 0 && (iteration.is_multiple_of(period) || (1..=LAST_CORRECTIONS).any(is_last))
}

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Corrects the expected bits, if that is due: from the end of densification on.
    pub(super) fn correct_expected_bits(&mut self, iteration: usize) {
        if !is_due(iteration, self.config.train.fine_iterations) || !self.gaussian_rate_is_active(iteration) {
            return;
        }
        let meta = scene_meta(&self.config, &self.data);
        let Some(compression) = self.state.compression.as_mut().filter(|models| models.attributes.is_some()) else {
            return;
        };
        // A scene that cannot be coded has diverged, and the trainer says so.
        let _ = compression.correct_expected_bits(&self.state.scene, meta, &self.config.compression);
        self.profile.lap("size of the file");
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
