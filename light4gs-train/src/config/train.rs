//! `[train]`: how it is trained.

use light4gs_model::regularizer::PlaneRegularizer;
use serde::{Deserialize, Serialize};

use super::choice::choice;
use super::{PruneConfig, optional};
use crate::stage::Stage;

/// Stages, loss and bookkeeping of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainConfig {
    /// Iterations of the coarse stage, which trains static Gaussians.
    pub coarse_iterations: usize,
    /// Iterations of the fine stage, which trains everything.
    pub fine_iterations: usize,
    /// Frames an iteration.
    pub batch_size: usize,
    /// Which frames stand in a batch.
    pub sampling: Sampling,
    /// The coarse stage sees the frames of so many times from the beginning; `None` (0 in TOML) those of all times.
    #[serde(with = "optional")]
    pub coarse_times: Option<usize>,
    /// Weight of D-SSIM in the loss; L1 has the rest.
    pub lambda_dssim: f32,
    /// The loss is the squared difference until this iteration of the fine stage, and in the coarse stage if it is not 0.
    /// L1 is content with the median, which for an object that passes quickly is the background behind it.
    pub l2_until: usize,
    /// The active degree of the spherical harmonics grows by one every so many iterations.
    pub sh_degree_interval: usize,
    /// A checkpoint is written every so many iterations.
    pub checkpoint_interval: usize,
    /// A line of `metrics.jsonl` is written every so many iterations.
    pub log_interval: usize,
    /// The newest checkpoints that are kept.
    pub keep_checkpoints: usize,
    /// Learning rates by parameter group.
    pub learning_rate: LearningRates,
    /// Cloning, splitting, pruning and opacity reset.
    pub densify: DensifyConfig,
    /// Dropping the least significant Gaussians.
    pub prune: PruneConfig,
    /// Weights of the space-time regularizers, used in the fine stage.
    pub regularizer: RegularizerConfig,
}

choice! {
    /// Which frames stand in a batch.
    pub enum Sampling: "sampling" {
        /// Any, in an order that is shuffled anew when all have been seen.
        Shuffled = "shuffled",
        /// Different cameras at one time. Where a time has fewer cameras than a batch, the batch goes on with another one.
        SameTime = "same_time",
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

    /// Iterations of a stage.
    pub fn iterations(&self, stage: Stage) -> usize {
        match stage {
            Stage::Coarse => self.coarse_iterations,
            Stage::Fine => self.fine_iterations,
        }
    }
}

/// Learning rates; those with `init` and `final` decay exponentially.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LearningRates {
    /// Positions, at the first step.
    pub means_init: f64,
    /// Positions, at the end of the schedule.
    pub means_final: f64,
    /// Deformation network, at the first step.
    pub deformation_init: f64,
    /// Deformation network, at the end of the schedule.
    pub deformation_final: f64,
    /// Hexplanes, at the first step.
    pub grid_init: f64,
    /// Hexplanes, at the end of the schedule.
    pub grid_final: f64,
    /// Constant color.
    pub sh_dc: f64,
    /// View-dependent color learns this many times slower than the constant one.
    pub sh_rest_divisor: f64,
    /// Opacity logits.
    pub opacity: f64,
    /// Logarithms of the scales.
    pub scale: f64,
    /// Quaternions.
    pub rotation: f64,
    /// What the rates of colors, opacities, scales and rotations have decayed to at the end of the schedule, as a
    /// share of those above; 1 keeps them constant.
    pub attributes_final_share: f64,
    /// Length of the decay in iterations; `None` (0 in TOML) takes the stage's length.
    #[serde(with = "optional")]
    pub schedule_steps: Option<usize>,
    /// Whether the rates of positions, deformation and hexplanes are multiplied by the scene's extent.
    pub scale_by_extent: bool,
}

/// Adaptive density control, as in 3DGS. Iterations count from 1 in each stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DensifyConfig {
    /// Cloning and splitting start after this iteration.
    pub from: usize,
    /// Cloning, splitting and opacity reset end before this iteration.
    pub until: usize,
    /// Cloning and splitting happen every so many iterations.
    pub interval: usize,
    /// Screen-space gradient above which a Gaussian is cloned or split, in the coarse stage.
    pub grad_threshold_coarse: f32,
    /// The same at the start of the fine stage.
    pub grad_threshold_fine_init: f32,
    /// The same at iteration `until` of the fine stage; linear in between.
    pub grad_threshold_fine_final: f32,
    /// Gaussians up to this share of the scene's extent are cloned, larger ones split.
    pub percent_dense: f32,
    /// No cloning or splitting from this many Gaussians on.
    pub max_gaussians: usize,
    /// Opacity below which a Gaussian is removed, in the coarse stage.
    pub opacity_threshold: f32,
    /// The same at the start of the fine stage.
    pub opacity_threshold_fine_init: f32,
    /// The same at iteration `until` of the fine stage; linear in between.
    pub opacity_threshold_fine_final: f32,
    /// Pruning starts after this iteration.
    pub prune_from: usize,
    /// Pruning happens every so many iterations.
    pub prune_interval: usize,
    /// Pruning only happens above this many Gaussians; 0 means always.
    pub prune_above: usize,
    /// Opacities are reset every so many iterations; 0 = never.
    pub opacity_reset_interval: usize,
}

/// Weights of the space-time regularizers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RegularizerConfig {
    /// Smoothness of the space-only planes.
    pub plane_tv: f32,
    /// Smoothness over time of the space-time planes.
    pub time_smoothness: f32,
    /// Distance of the space-time planes from 1, which means "no motion".
    pub time_l1: f32,
}

impl RegularizerConfig {
    /// The regularizer that this stands for.
    pub fn build(&self) -> PlaneRegularizer {
        let Self { plane_tv, time_smoothness, time_l1 } = *self;
        PlaneRegularizer { plane_smoothness: plane_tv, time_smoothness, time_l1 }
    }
}

impl Default for TrainConfig {
    fn default() -> Self {
        Self {
            coarse_iterations: 3000,
            fine_iterations: 30_000,
            batch_size: 1,
            sampling: Sampling::Shuffled,
            coarse_times: None,
            lambda_dssim: 0.0,
            l2_until: 0,
            sh_degree_interval: 1000,
            checkpoint_interval: 1000,
            log_interval: 10,
            keep_checkpoints: 2,
            learning_rate: LearningRates::default(),
            densify: DensifyConfig::default(),
            prune: PruneConfig::default(),
            regularizer: RegularizerConfig::default(),
        }
    }
}

impl Default for LearningRates {
    fn default() -> Self {
        Self {
            means_init: 1.6e-4,
            means_final: 1.6e-6,
            deformation_init: 1.6e-4,
            deformation_final: 1.6e-5,
            grid_init: 1.6e-3,
            grid_final: 1.6e-4,
            sh_dc: 2.5e-3,
            sh_rest_divisor: 20.0,
            opacity: 0.05,
            scale: 0.005,
            rotation: 0.001,
            attributes_final_share: 1.0,
            schedule_steps: None,
            scale_by_extent: true,
        }
    }
}

impl Default for DensifyConfig {
    fn default() -> Self {
        Self {
            from: 500,
            until: 15_000,
            interval: 100,
            grad_threshold_coarse: 2e-4,
            grad_threshold_fine_init: 2e-4,
            grad_threshold_fine_final: 2e-4,
            percent_dense: 0.01,
            max_gaussians: 360_000,
            opacity_threshold: 0.005,
            opacity_threshold_fine_init: 0.005,
            opacity_threshold_fine_final: 0.005,
            prune_from: 500,
            prune_interval: 100,
            prune_above: 200_000,
            opacity_reset_interval: 3000,
        }
    }
}

impl Default for RegularizerConfig {
    fn default() -> Self {
        Self { plane_tv: 1e-4, time_smoothness: 1e-2, time_l1: 1e-4 }
    }
}
