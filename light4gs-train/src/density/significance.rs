//! Scores by which Gaussians are pruned (paper III-B).

use light4gs_model::{PixelContribution as Sum, Significance, VolumeWeight};

use crate::config::{PruneConfig, PruneScore, PruneVolume};

/// What the training views say of each of `N` Gaussians, each at its time.
#[derive(Clone, Debug, Default)]
pub struct GaussianContributions {
    /// `[N]`: pixels that blend the Gaussian, over all views.
    pub pixels: Vec<f64>,
    /// `[N]`: sum over those pixels of transmittance times alpha.
    pub blending_weight: Vec<f64>,
    /// `[N]`: sum over those pixels of transmittance times opacity.
    pub transmittance_opacity: Vec<f64>,
    /// `[N]`: sum over those pixels of the Gaussian's opacity.
    pub opacity: Vec<f64>,
    /// `[N]`: products of the standard deviations, world units cubed.
    pub volumes: Vec<f64>,
}

impl GaussianContributions {
    /// From the sums over views, and the Gaussians' volumes.
    pub fn new(significance: &Significance, volumes: Vec<f64>) -> Self {
        Self {
            pixels: significance.sums(Sum::PixelCount),
            blending_weight: significance.sums(Sum::BlendingWeight),
            transmittance_opacity: significance.sums(Sum::TransmittanceOpacity),
            opacity: significance.sums(Sum::Opacity),
            volumes,
        }
    }
}

/// Says how much each Gaussian contributes to the training views; those with the smallest scores are pruned.
pub trait SignificanceScore: Send {
    /// `[N]`: the larger, the more it contributes. Must be finite.
    fn scores(&self, contributions: &GaussianContributions) -> Vec<f64>;
}

/// A sum over pixels times a factor of the Gaussian's volume: the paper's score, and its variants. The default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeWeightedScore {
    /// What is summed.
    pub contribution: PruneScore,
    /// The factor.
    pub volume: VolumeWeight,
}

impl VolumeWeightedScore {
    /// As a configuration says.
    pub fn new(config: &PruneConfig) -> Self {
        let exponent = config.volume_exponent;
        let volume = match config.volume {
            PruneVolume::None => VolumeWeight::None,
            PruneVolume::Clamped => VolumeWeight::Clamped { exponent },
            PruneVolume::Unclamped => VolumeWeight::Unclamped { exponent },
        };
        Self { contribution: config.score, volume }
    }
}

impl SignificanceScore for VolumeWeightedScore {
    fn scores(&self, contributions: &GaussianContributions) -> Vec<f64> {
        let sums = match self.contribution {
            PruneScore::Transmittance => &contributions.transmittance_opacity,
            PruneScore::Weight => &contributions.blending_weight,
            PruneScore::Opacity => &contributions.opacity,
            PruneScore::Count => &contributions.pixels,
        };
        sums.iter().zip(self.volume.of(&contributions.volumes)).map(|(sum, factor)| sum * factor).collect()
    }
}
