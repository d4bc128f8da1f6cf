//! The weight of the rate follows the size or the quality of the file, where the file shall have a certain one.

use light4gs_codec::Encoded;
use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::{EntropyModels, encoded_so_far, mean_psnr, measured_views};
use crate::dataset::scene_meta;
use crate::error::TrainError;

/// The fine stage has so many iterations between two corrections that there would be this many of them in all of it.
const CORRECTIONS: usize = 64;
/// A correction multiplies the weight by the ratio of the bytes, to this power. Bytes go about as the fourth root of the
/// weight, once the scene has followed it, which takes several corrections.
const POWER: f64 = 0.7;
/// A correction multiplies the weight by this for each dB above the wished PSNR. A dB is a factor of 20 to 50 in the
/// weight, which the scene follows slowly.
const FACTOR_OF_A_DECIBEL: f64 = 2.0;
/// A quality is steered to in this last share of the fine stage: before, a scene is not yet nearly as good as it will be.
const STEERED_BY_QUALITY: f64 = 0.4;
/// The weight becomes smaller than the configured one in this last share only: until then a scene that is not good enough
/// may still become so.
const RELIEVED: f64 = 0.15;
/// Up to twice as many views are all measured: of a few, chosen ones may be some tenths of a dB better or worse than all.
const VIEWS: usize = 100;
/// The weight stays within this factor of the configured one, up and down.
const MOST: f64 = 100.0;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Corrects the weight of the rate, if that is due: from the end of densification on.
    ///
    /// # Errors
    /// A test image that cannot be read.
    pub(super) fn steer_rate(&mut self, iteration: usize) -> Result<(), TrainError> {
        let iterations = self.config.train.fine_iterations;
        let interval = (iterations / CORRECTIONS).max(1);
        let settings = &self.config.compression;
        let steered = settings.target_bytes > 0 || settings.target_db > 0.0;
        if !steered || !iteration.is_multiple_of(interval) || !self.gaussian_rate_is_active(iteration) {
            return Ok(());
        }
        let left = 1.0 - iteration as f64 / iterations as f64;
        if settings.target_db > 0.0 && left > STEERED_BY_QUALITY {
            return Ok(());
        }
        let least = if settings.target_db > 0.0 && left > RELIEVED { 1.0 } else { 1.0 / MOST };
        let Some(compression) = &self.state.compression else { return Ok(()) };
        let meta = scene_meta(&self.config, &self.data);
        // A scene that cannot be coded has diverged, and the trainer says so.
        let Ok(encoded) = encoded_so_far(&self.state.scene, compression, meta, settings) else { return Ok(()) };
        let factor = match settings.target_bytes {
            0 => FACTOR_OF_A_DECIBEL.powf(self.psnr_of(&encoded)? - settings.target_db),
            target => (self.expected_bytes(&encoded, iteration) / target as f64).powf(POWER),
        };
        let weight = &mut self.state.rate_weight;
        *weight = (*weight * factor).clamp(least, MOST);
        self.profile.lap("size of the file");
        Ok(())
    }

    /// Bytes of the file after all passes of pruning that are to come.
    fn expected_bytes(&self, encoded: &Encoded, iteration: usize) -> f64 {
        let report = &encoded.report;
        let [mut gaussians, mut others] = [0, report.header_bytes];
        for (name, .., bytes) in &report.sections {
            *(if matches!(*name, "gaussians" | "sh") { &mut gaussians } else { &mut others }) += bytes;
        }
        let prune = &self.config.train.prune;
        let passes = prune.iterations.iter().filter(|pass| **pass > iteration).count();
        gaussians as f64 * (1.0 - prune.fraction).powi(passes as i32) + others as f64
    }

    /// PSNR of the decoded file on some of the views by which it will be measured, dB.
    fn psnr_of(&self, encoded: &Encoded) -> Result<f64, TrainError> {
        let views = measured_views(&self.data);
        let views = views.iter().step_by((views.len() / VIEWS).max(1));
        mean_psnr::<F>(&encoded.decoded, views, &*self.images, &self.device.clone().inner())
    }
}
