//! `[train.prune]`: significance pruning (STP, paper III-B).

use serde::{Deserialize, Serialize};

use super::choice::choice;

/// When and how the least significant Gaussians are dropped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PruneConfig {
    /// Share of the Gaussians that each pass drops; 0 = no pruning. The paper has 0.1, 0.2, 0.3 and 0.4.
    pub fraction: f64,
    /// Iterations of the fine stage after which a pass takes place.
    pub iterations: Vec<usize>,
    /// What a pixel adds to the score of a Gaussian that it blends.
    pub score: PruneScore,
    /// The factor of a Gaussian's volume.
    pub volume: PruneVolume,
    /// Exponent of the volume's factor.
    pub volume_exponent: f64,
    /// Whether only one random camera a time is looked through, for data with many cameras; else every training view.
    pub one_camera_per_time: bool,
}

impl Default for PruneConfig {
    fn default() -> Self {
        Self {
            fraction: 0.0,
            iterations: vec![15_001, 20_000],
            score: PruneScore::Transmittance,
            volume: PruneVolume::Clamped,
            volume_exponent: 0.1,
            one_camera_per_time: false,
        }
    }
}

choice! {
    /// What a pixel adds to the significance of a Gaussian that it blends.
    pub enum PruneScore: "score" {
        /// Transmittance before the Gaussian times its opacity: the paper's.
        Transmittance = "transmittance",
        /// The blending weight, transmittance times alpha.
        Weight = "weight",
        /// The opacity alone, as the first public code of LightGaussian does.
        Opacity = "opacity",
        /// One a pixel.
        Count = "count",
    }
}

choice! {
    /// The factor of a Gaussian's volume in its significance.
    pub enum PruneVolume: "volume" {
        /// None.
        None = "none",
        /// Relative to the volume that 90 % stay below, at most 1: the paper's.
        Clamped = "clamped",
        /// Relative to the volume that 10 % stay below, without a bound: the public code's.
        Unclamped = "unclamped",
    }
}

impl PruneConfig {
    /// Whether a pass takes place after an iteration of the fine stage.
    pub fn is_due(&self, iteration: usize) -> bool {
        self.fraction > 0.0 && self.iterations.contains(&iteration)
    }
}
