//! `[train.prune]`: significance pruning (STP, paper III-B).

use light4gs_model::{SignificanceScore, VolumeWeight};
use serde::{Deserialize, Serialize};

/// When and how the least significant Gaussians are dropped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PruneConfig {
    /// Share of the Gaussians that each pass drops; 0 = no pruning. The paper has 0.1, 0.2, 0.3 and 0.4.
    pub fraction: f64,
    /// Iterations of the fine stage after which a pass takes place.
    pub iterations: Vec<usize>,
    /// What a pixel adds to the score of a Gaussian that it blends: `transmittance`, `weight`, `opacity` or `count`.
    pub score: String,
    /// The factor of a Gaussian's volume: `none`, `clamped` or `unclamped`.
    pub volume: String,
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
            score: "transmittance".to_owned(),
            volume: "clamped".to_owned(),
            volume_exponent: 0.1,
            one_camera_per_time: false,
        }
    }
}

/// What `score` may be: transmittance times opacity (the paper's), transmittance times alpha, the opacity alone, or
/// one (a pixel count).
pub(super) const SCORES: &[&str] = &["transmittance", "weight", "opacity", "count"];
/// What `volume` may be: no factor, the paper's, or the public code's.
pub(super) const VOLUMES: &[&str] = &["none", "clamped", "unclamped"];

impl PruneConfig {
    /// The score that [`Self::score`] names.
    pub fn score(&self) -> SignificanceScore {
        match self.score.as_str() {
            "weight" => SignificanceScore::BlendingWeight,
            "opacity" => SignificanceScore::Opacity,
            "count" => SignificanceScore::PixelCount,
            _ => SignificanceScore::TransmittanceOpacity,
        }
    }

    /// The volume factor that [`Self::volume`] names.
    pub fn volume_weight(&self) -> VolumeWeight {
        let exponent = self.volume_exponent;
        match self.volume.as_str() {
            "none" => VolumeWeight::None,
            "unclamped" => VolumeWeight::Unclamped { exponent },
            _ => VolumeWeight::Clamped { exponent },
        }
    }

    /// Whether a pass takes place after an iteration of the fine stage.
    pub fn is_due(&self, iteration: usize) -> bool {
        self.fraction > 0.0 && self.iterations.contains(&iteration)
    }
}
