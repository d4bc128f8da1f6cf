//! The bits that are expected of each attribute follow those that the coder writes.

use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::EntropyModels;
use crate::dataset::scene_meta;

/// The fine stage has so many iterations between two corrections that there would be this many of them in all of it. The
/// last iteration has none: nothing is trained after it.
const CORRECTIONS: usize = 12;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Corrects the expected bits, if that is due: from the end of densification on.
    pub(super) fn correct_expected_bits(&mut self, iteration: usize) {
        let iterations = self.config.train.fine_iterations;
        let is_due = iteration.is_multiple_of((iterations / CORRECTIONS).max(1)) && iteration < iterations;
        if !is_due || !self.gaussian_rate_is_active(iteration) {
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
