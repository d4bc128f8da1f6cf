//! Scores by which Gaussians are pruned (paper III-B).

use light4gs_keys::Bounds::{Flag, List, Number};
use light4gs_keys::{INTERVAL, choice, keys};
use light4gs_model::{PixelContribution as Sum, Sensitivity, Significance, VolumeWeight};

keys! {
    /// Significance pruning (STP, paper III-B). Pruning takes place in passes, after the end of densification. Each
    /// pass drops the Gaussians that contribute least to the training views, at the times of these views.
    pub struct PruneConfig {
        /// Share of the Gaussians that each pass drops; 0 = never. Two passes with 0.1, 0.2, 0.3 or 0.4 together drop
        /// 19, 36, 51 or 64 %.
        fraction: f64 = 0.0;
            Number { least: 0.0, most: 0.999 },
            "paper: 0.1 to 0.4";
        /// Iterations of the fine stage after which a pass takes place. All of these iterations must be after the end
        /// of densification.
        iterations: Vec<usize> = vec![15_001, 20_000];
            List { element: &INTERVAL, length: None },
            "paper: mid-way and near the end";
        /// What a pixel adds to the score of each Gaussian that it blends.
        score: PruneScore = PruneScore::Transmittance;
            PruneScore::BOUNDS, "paper; the reference sums the opacity";
        /// Factor of a Gaussian's score that follows from its volume V.
        volume: PruneVolume = PruneVolume::Clamped;
            PruneVolume::BOUNDS, "paper";
        /// Exponent in the factor of `train.prune.volume`.
        volume_exponent: f64 = 0.1; Number { least: 1e-6, most: 3.0 }, "LightGaussian";
        /// Whether a pass of pruning uses one random camera for each time instead of every training view. Such a pass
        /// is meant for data with many cameras.
        one_camera_per_time: bool = false; Flag, "paper, multi-view data";
    }
}

choice! {
    /// What a pixel adds to the score of each Gaussian that it blends.
    pub enum PruneScore: "score" {
        /// The transmittance in front of the Gaussian, multiplied by the Gaussian's opacity. This is the paper's score.
        Transmittance = "transmittance",
        /// The squared change of the pixel's color if the Gaussian is removed (after SpeeDe3DGS).
        Sensitivity = "sensitivity",
    }
}

choice! {
    /// The factor of a Gaussian's volume in its significance.
    pub enum PruneVolume: "volume" {
        /// The factor is 1.
        None = "none",
        /// The factor is clamp(V / V_90, 0, 1)^exponent, where 90 % of the volumes are below V_90. This is the paper's
        /// factor.
        Clamped = "clamped",
    }
}

impl PruneConfig {
    /// Whether there is a pass after an iteration of the fine stage.
    pub fn is_due(&self, iteration: usize) -> bool {
        self.fraction > 0.0 && self.iterations.contains(&iteration)
    }
}

/// The contributions of each of `N` Gaussians to the training views, each view at its time.
#[derive(Clone, Debug, Default)]
pub struct GaussianContributions {
    /// `[N]`: pixels that blend the Gaussian, over all views.
    pub pixels: Vec<f64>,
    /// `[N]`: sum over those pixels of transmittance times alpha.
    pub blending_weight: Vec<f64>,
    /// `[N]`: sum over those pixels of transmittance times opacity.
    pub transmittance_opacity: Vec<f64>,
    /// `[N]`: sum over those pixels of the squared change of their color without the Gaussian. Empty unless the score
    /// [reads it](SignificanceScore::reads_sensitivity).
    pub sensitivity: Vec<f64>,
    /// `[N]`: products of the standard deviations, world units cubed.
    pub volumes: Vec<f64>,
}

impl GaussianContributions {
    /// From the sums over views, and the Gaussians' volumes.
    pub fn new(significance: &Significance, sensitivity: Option<&Sensitivity>, volumes: Vec<f64>) -> Self {
        Self {
            pixels: significance.sums(Sum::PixelCount),
            blending_weight: significance.sums(Sum::BlendingWeight),
            transmittance_opacity: significance.sums(Sum::TransmittanceOpacity),
            sensitivity: sensitivity.map_or_else(Vec::new, |sensitivity| sensitivity.sums().to_vec()),
            volumes,
        }
    }
}

/// Scores the contribution of each Gaussian to the training views. Those with the smallest scores are pruned.
pub trait SignificanceScore: Send {
    /// `[N]`: the larger, the more it contributes. Must be finite.
    fn scores(&self, contributions: &GaussianContributions) -> Vec<f64>;

    /// Whether it reads [`GaussianContributions::sensitivity`], which takes a backward pass for each view.
    fn reads_sensitivity(&self) -> bool {
        false
    }
}

/// A sum over pixels times a factor of the Gaussian's volume: the paper's score, or sensitivity. The default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeWeightedScore {
    /// The quantity that is summed.
    pub contribution: PruneScore,
    /// The factor of the volume.
    pub volume: VolumeWeight,
}

impl VolumeWeightedScore {
    /// As configured.
    pub fn new(config: &PruneConfig) -> Self {
        let exponent = config.volume_exponent;
        let volume = match config.volume {
            PruneVolume::None => VolumeWeight::None,
            PruneVolume::Clamped => VolumeWeight::Clamped { exponent },
        };
        Self { contribution: config.score, volume }
    }
}

impl SignificanceScore for VolumeWeightedScore {
    fn scores(&self, contributions: &GaussianContributions) -> Vec<f64> {
        let sums = match self.contribution {
            PruneScore::Transmittance => &contributions.transmittance_opacity,
            PruneScore::Sensitivity => &contributions.sensitivity,
        };
        sums.iter().zip(self.volume.of(&contributions.volumes)).map(|(sum, factor)| sum * factor).collect()
    }

    fn reads_sensitivity(&self) -> bool {
        self.contribution == PruneScore::Sensitivity
    }
}
