//! `[train]`: how it is trained.

use light4gs_data::Camera;
use light4gs_keys::Bounds::{self, Number, Whole};
use light4gs_keys::{ByName, INTERVAL, ITERATION, ITERATIONS, RATE, SHARE, keys, optional};
use light4gs_model::regularizer::PlaneRegularizer;

use super::attributes::built_in;
use crate::corrections::CorrectionsConfig;
use crate::density::{DensifyConfig, GuidedSamplingConfig, PruneConfig};
use crate::loss::{LossKind, Losses};
use crate::sampling::{SamplerKind, Samplers};
use crate::stage::Stage;

keys! {
    /// Stages, loss and bookkeeping.
    pub struct TrainConfig {
        /// Iterations of the coarse stage: static Gaussians, no deformation.
        coarse_iterations: usize = 3000; ITERATIONS, "paper";
        /// Iterations of the fine stage, which are counted from 1 again. The fine stage begins with a new optimizer.
        fine_iterations: usize = 30_000; ITERATIONS, "paper: 30000 for D-NeRF, 20000 elsewhere";
        /// Frames per iteration.
        batch_size: usize = 1; Whole { least: 1, most: 1024 }, "paper: 1 for D-NeRF, 2 to 4 elsewhere";
        /// The loss by which rendered views are compared with the frames. The keys of each loss are in the table with
        /// the loss's name.
        loss: LossKind = LossKind::Photometric;
            LossKind::BOUNDS, "3DGS";
        /// The keys of the losses.
        #[serde(flatten)]
        losses: Losses;
        /// Which frames an iteration looks at.
        sampling: SamplerKind = SamplerKind::Shuffled; SamplerKind::BOUNDS, "ours; the reference shuffles";
        /// The keys of the samplers.
        #[serde(flatten)]
        samplers: Samplers;
        /// Iterations after which the active degree of the spherical harmonics grows by one.
        sh_degree_interval: usize = 1000; INTERVAL, "3DGS";
        /// Iterations between two checkpoints.
        checkpoint_interval: usize = 1000; INTERVAL, "ours";
        /// Iterations between two lines of `metrics.jsonl`.
        log_interval: usize = 10; INTERVAL, "ours";
        /// Number of checkpoints that are kept, the newest ones.
        keep_checkpoints: usize = 2; INTERVAL, "ours";
        /// Exposures, poses and times that the dataset has not quite right.
        #[serde(flatten)]
        corrections: CorrectionsConfig;
        /// Smaller images first.
        coarse_to_fine: CoarseToFineConfig;
        /// Learning rates by parameter group.
        learning_rate: LearningRates;
        /// Cloning, splitting, pruning and opacity reset.
        densify: DensifyConfig;
        /// Dropping the least significant Gaussians.
        prune: PruneConfig;
        /// Adding Gaussians where frames are not explained.
        guided_sampling: GuidedSamplingConfig;
        /// Weights of the space-time regularizers, used in the fine stage.
        regularizer: PlaneRegularizer;
    }
}

impl TrainConfig {
    /// Iterations done over both stages, after `iteration` of a stage.
    pub fn global_step(&self, stage: Stage, iteration: usize) -> usize {
        match stage {
            Stage::Coarse => iteration,
            Stage::Fine => self.coarse_iterations + iteration,
        }
    }

    /// The share of the fine stage that is over before this iteration of a stage.
    pub fn progress(&self, stage: Stage, iteration: usize) -> f64 {
        match stage {
            Stage::Coarse => 0.0,
            Stage::Fine => iteration.saturating_sub(1) as f64 / self.fine_iterations.max(1) as f64,
        }
    }

    /// Iterations of a stage.
    pub fn iterations(&self, stage: Stage) -> usize {
        match stage {
            Stage::Coarse => self.coarse_iterations,
            Stage::Fine => self.fine_iterations,
        }
    }
}

keys! {
    /// Training begins with smaller images. While images are smaller, `max_gaussians` is reduced too. An iteration with
    /// smaller images takes a fraction of the time. In the coarse stage, images have the size with which the fine stage
    /// begins. No side of an image is made shorter than 200 pixels.
    pub struct CoarseToFineConfig {
        /// Images have a quarter of their width and height until this share of the fine stage is over. 0 means never.
        quarter_until: f64 = 0.0; SHARE, "ours";
        /// Images have half of their width and height until this share of the fine stage is over. 0 means never.
        half_until: f64 = 0.0; SHARE, "ours";
    }
}

/// Least shorter side of a reduced image, pixels: the size for which the presets' numbers were chosen. At 126 pixels,
/// `neu3d_mini` lost a decibel.
const FEWEST_PIXELS: u32 = 200;

impl CoarseToFineConfig {
    /// The number by which width and height of this camera's images are divided: 4, 2 or 1. `progress` is the share of
    /// the fine stage that is over, 0 in the coarse stage.
    pub fn factor(&self, progress: f64, camera: &Camera) -> u32 {
        let most = camera.width.min(camera.height) / FEWEST_PIXELS;
        match () {
            () if progress < self.quarter_until && most >= 4 => 4,
            () if progress < self.quarter_until.max(self.half_until) && most >= 2 => 2,
            () => 1,
        }
    }
}

keys! {
    /// Adam's learning rates. A learning rate with an `init` and a `final` value decays exponentially from the first
    /// value to the second. The learning rates of positions, deformation and feature planes are multiplied by the
    /// scene's extent.
    pub struct LearningRates {
        /// Learning rate of the deformation network at the first training step.
        deformation_init: f64 = 1.6e-4; RATE, "reference";
        /// Learning rate of the deformation network at the end of the schedule.
        deformation_final: f64 = 1.6e-5; RATE, "reference";
        /// Learning rate of the feature planes at the first training step.
        planes_init: f64 = 1.6e-3; RATE, "reference";
        /// Learning rate of the feature planes at the end of the schedule.
        planes_final: f64 = 1.6e-4; RATE, "reference";
        /// Learning rates of the Gaussians' attributes at the first training step. Further attributes, such as
        /// `stillness` of control nodes or an attribute of a field of your own, can be named as well. If a further
        /// attribute is not named, it has the learning rate that its field gives it.
        attributes_init: ByName = built_in(|attribute| Some(attribute.learning_rate.initial));
            Bounds::ByName(&RATE), "3DGS";
        /// Learning rates of the Gaussians' attributes at the end of the schedule. An attribute that is not named here
        /// keeps its learning rate of the beginning, unless its field gives another one.
        attributes_final: ByName = built_in(|attribute| attribute.learning_rate.last);
            Bounds::ByName(&RATE), "3DGS";
        /// Length of the decay in iterations. 0 means the length of the stage.
        #[serde(with = "optional")]
        schedule_steps: Option<usize> = None; ITERATION, "ours; reference: 20000";
        /// Length of the cooldown at the end of the fine stage, as a share of this stage. In the cooldown, all learning
        /// rates of this table fall faster than by their usual decay. The cooldown averages away the noise of the
        /// training steps, after motion has been found. 0 means no cooldown.
        cooldown: f64 = 0.0; SHARE, "ours; the last phase of warmup-stable-decay (Hu et al. 2024)";
        /// Factor by which the cooldown multiplies the learning rates; it falls from 1 to this value during the
        /// cooldown.
        cooldown_factor: f64 = 0.1; Number { least: 1e-6, most: 1.0 }, "ours";
    }
}

impl LearningRates {
    /// The factor of the rates when this share of the fine stage is over.
    pub fn cooled(&self, progress: f64) -> f64 {
        let begin = 1.0 - self.cooldown;
        if progress <= begin { 1.0 } else { self.cooldown_factor.powf((progress - begin) / self.cooldown) }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn rates_cool_down_at_the_end() {
        let rates = LearningRates { cooldown: 0.5, cooldown_factor: 0.01, ..LearningRates::default() };
        let found = [0.0, 0.5, 0.75, 1.0].map(|progress| rates.cooled(progress));
        assert_eq!(found.map(|factor| (factor * 1e6).round() / 1e6), [1.0, 1.0, 0.1, 0.01]);
        assert_eq!(LearningRates::default().cooled(1.0), 1.0);
    }

    #[test]
    fn images_grow_from_coarse_to_fine() {
        let coarse_to_fine = CoarseToFineConfig { quarter_until: 0.1, half_until: 0.5 };
        let view = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 1.0, 1600, 900);
        assert_eq!(
            [0.0, 0.09, 0.1, 0.49, 0.5, 1.0].map(|progress| coarse_to_fine.factor(progress, &view)),
            [4, 4, 2, 2, 1, 1]
        );
        // Not below 200 pixels.
        let of_height = |height| coarse_to_fine.factor(0.0, &Camera { height, ..view });
        assert_eq!([800, 799, 400, 399, 1].map(of_height), [4, 2, 2, 1, 1]);
        assert_eq!(CoarseToFineConfig::default().factor(0.0, &view), 1);
    }
}
