//! The weight of the rate follows the size of the file, where the file shall have a certain size.

use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::{EntropyModels, size_so_far};

/// The fine stage has so many iterations between two corrections that there would be this many of them in all of it.
const CORRECTIONS: usize = 64;
/// A correction multiplies the weight by the ratio of the bytes, to this power. Bytes go about as the fourth root of the
/// weight, once the scene has followed it, which takes several corrections.
const POWER: f64 = 0.7;
/// The weight stays within this factor of the configured one, up and down.
const MOST: f64 = 100.0;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Corrects the weight of the rate, if that is due: from the end of densification on.
    pub(super) fn steer_size(&mut self, iteration: usize) {
        let target = self.config.compression.target_bytes;
        let interval = (self.config.train.fine_iterations / CORRECTIONS).max(1);
        if target == 0 || !iteration.is_multiple_of(interval) || !self.gaussian_rate_is_active(iteration) {
            return;
        }
        let Some(compression) = &self.state.compression else { return };
        // A scene that cannot be coded has diverged, and the trainer says so.
        let Ok([gaussians, others]) = size_so_far(&self.state.scene, compression, &self.config.compression) else {
            return;
        };
        let prune = &self.config.train.prune;
        let passes = prune.iterations.iter().filter(|pass| **pass > iteration).count();
        let kept = (1.0 - prune.fraction).powi(passes as i32);
        let expected = gaussians as f64 * kept + others as f64;
        let weight = &mut self.state.rate_weight;
        *weight = (*weight * (expected / target as f64).powf(POWER)).clamp(1.0 / MOST, MOST);
        self.profile.lap("size of the file");
    }
}
