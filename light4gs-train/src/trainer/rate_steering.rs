//! Steers the weight of the rate so that the file gets a wished size or quality.

use light4gs_codec::Encoded;
use light4gs_model::DeformationField;

use super::Trainer;
use crate::compression::{EntropyModels, mean_psnr, measured_views, splatter_of};
use crate::error::TrainError;

/// Corrections per fine stage.
const CORRECTIONS: usize = 64;
/// A correction multiplies the weight by (bytes / wished bytes) to this power. Bytes go about as the fourth root of the
/// weight, once the scene has followed it, which takes several corrections.
const POWER: f64 = 0.7;
/// A correction multiplies the weight by this for each dB above the wished PSNR. A dB is a factor of 20 to 50 in the
/// weight, which the scene follows slowly.
const FACTOR_OF_A_DECIBEL: f64 = 2.0;
/// Share of the fine stage, at its end, in which the weight follows a wished quality. Before, the scene still becomes much
/// better.
const STEERED_BY_QUALITY: f64 = 0.4;
/// Share of the fine stage, at its end, in which the weight may fall below the configured one. Before, a scene that is not
/// good enough may still become so.
const RELIEVED: f64 = 0.15;
/// Every n-th view is measured, n = views / this, rounded down: a few views may be some tenths of a dB better or worse than all.
const VIEWS: usize = 100;
/// The weight stays within this factor of the configured one, up and down.
const MOST: f64 = 100.0;

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Whether the weight is to be corrected: from the end of densification on, where a size or a quality is wished.
    pub(super) fn steering_is_due(&self, iteration: usize) -> bool {
        let settings = &self.config.compression;
        let interval = (self.config.train.fine_iterations / CORRECTIONS).max(1);
        let steered = match settings.target_db > 0.0 {
            true => self.share_left(iteration) <= STEERED_BY_QUALITY,
            false => settings.target_bytes > 0,
        };
        steered && iteration.is_multiple_of(interval) && self.gaussian_rate_is_active(iteration)
    }

    /// Corrects the weight of the rate by the size or the quality of the scene's file.
    ///
    /// # Errors
    /// A test image that cannot be read.
    pub(super) fn steer_rate(&mut self, file: &Encoded, iteration: usize) -> Result<(), TrainError> {
        let settings = &self.config.compression;
        let relieved = settings.target_db <= 0.0 || self.share_left(iteration) <= RELIEVED;
        let least = if relieved { 1.0 / MOST } else { 1.0 };
        let factor = match settings.target_bytes {
            0 => FACTOR_OF_A_DECIBEL.powf(self.psnr_of(file)? - settings.target_db),
            target => (self.expected_bytes(file, iteration) / target as f64).powf(POWER),
        };
        let weight = &mut self.state.rate_weight;
        *weight = (*weight * factor).clamp(least, MOST);
        Ok(())
    }

    /// The share of the fine stage that is left after an iteration.
    fn share_left(&self, iteration: usize) -> f64 {
        1.0 - iteration as f64 / self.config.train.fine_iterations as f64
    }

    /// Bytes of the file after all passes of pruning that are to come.
    fn expected_bytes(&self, file: &Encoded, iteration: usize) -> f64 {
        let [mut gaussians, mut others] = [0, file.info.header_bytes];
        for section in &file.info.sections {
            *(if matches!(section.name, "gaussians" | "sh") { &mut gaussians } else { &mut others }) += section.bytes;
        }
        let prune = &self.config.train.prune;
        let passes = prune.iterations.iter().filter(|pass| **pass > iteration).count();
        gaussians as f64 * (1.0 - prune.fraction).powi(passes as i32) + others as f64
    }

    /// PSNR of the decoded file on some of the views by which it will be measured, dB.
    fn psnr_of(&self, file: &Encoded) -> Result<f64, TrainError> {
        let views = measured_views(&self.data);
        let views = views.iter().step_by((views.len() / VIEWS).max(1));
        let splatter = splatter_of(&file.decoded).with_backdrop(self.backdrop.clone());
        mean_psnr::<F>(&file.decoded, &splatter, views, &*self.images, &self.device.clone().inner())
    }
}
