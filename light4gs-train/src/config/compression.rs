//! `[compression]`: how small, and how (paper III-C to III-E).

use std::fmt;
use std::str::FromStr;

use light4gs_codec::attributes::AttributeSteps;
use light4gs_codec::network_weights::WeightPrecision;
use light4gs_codec::{Profile, WeightPrecisions};
use light4gs_model::AdaptiveQuantizationConfig;
use light4gs_model::ShKind;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::choice::{UnknownChoice, choice};

/// What the file looks like, and what is trained for its sake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CompressionConfig {
    /// How the file is written.
    pub profile: FileProfile,
    /// The rate in the loss.
    pub rate: RateConfig,
    /// The context model of the hexplanes (MHCM).
    pub context: ContextConfig,
    /// Quantization steps of the hexplanes.
    pub steps: StepsConfig,
    /// The entropy model of the spherical harmonics.
    pub sh: ShConfig,
    /// Steps of the other attributes, in the `compact` profile.
    pub attributes: AttributesConfig,
    /// Precision of network weights, in the `compact` profile.
    pub weights: WeightsConfig,
}

choice! {
    /// What is entropy coded in a file.
    pub enum FileProfile: "profile" {
        /// Everything.
        Compact = "compact",
        /// Planes and spherical harmonics; the rest is float32, as in the paper.
        Paper = "paper",
        /// Nothing.
        Float32 = "float32",
    }
}

impl FileProfile {
    /// The codec's name for it; none where nothing is entropy coded.
    pub fn coded(self) -> Option<Profile> {
        match self {
            Self::Compact => Some(Profile::Compact),
            Self::Paper => Some(Profile::Paper),
            Self::Float32 => None,
        }
    }
}

/// The rate term of the loss.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RateConfig {
    /// Weight of the rate; 0 = no rate in the loss.
    pub lambda: f64,
    /// What lambda weighs.
    pub weighting: RateWeighting,
    /// Whether the rate of the planes shapes the planes. Where it does not, their entropy model learns all the same.
    pub planes: bool,
    /// Whether the rate of the spherical harmonics shapes the Gaussians. Where it does not, its model learns all the same.
    pub sh: bool,
    /// The rate is taken in every so many iterations.
    pub interval: usize,
    /// Share of the planes, and of the Gaussians, on which it is estimated.
    pub fraction: f64,
    /// Iteration of the fine stage from which planes carry noise and the rate counts. Spherical harmonics join once
    /// densification is over.
    pub from: usize,
    /// Iteration of the fine stage after which the planes are frozen: they take the values that the file will have, and
    /// the rest of the scene goes on learning around them. 0 = never.
    pub planes_until: usize,
}

choice! {
    /// What `compression.rate.lambda` weighs.
    pub enum RateWeighting: "weighting" {
        /// Megabytes (10^6 bytes) in the file.
        Megabytes = "megabytes",
        /// The paper's sum of the bits per plane symbol and the bits per spherical-harmonics symbol.
        PerSymbol = "per_symbol",
    }
}

/// Parts and sizes of the context model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ContextConfig {
    /// Sizes of its networks.
    pub architecture: ContextArchitecture,
    /// Whether the lowest scale's space-time planes send a hyperprior.
    pub hyperprior: bool,
    /// Whether the second half of the lowest scale's positions sees the first.
    pub checkerboard: bool,
    /// Whether space-only planes are predicted from space-time planes.
    pub inter_plane: bool,
    /// Whether higher scales are predicted from the one below.
    pub inter_scale: bool,
    /// Whether higher scales send a hyperprior as well, as the public code does.
    pub high_scale_hyperprior: bool,
    /// Learning rate at the first step.
    pub learning_rate_init: f64,
    /// Learning rate at the end of the fine stage.
    pub learning_rate_final: f64,
    /// Steps that fit the model to planes that were trained without it, when such a checkpoint is encoded.
    pub fit_iterations: usize,
}

choice! {
    /// Sizes of the context model's networks.
    pub enum ContextArchitecture: "architecture" {
        /// Small networks, for small scenes.
        Compact = "compact",
        /// The public code's sizes.
        Reference = "reference",
    }
}

/// Quantization steps of the planes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StepsConfig {
    /// Step of the space-only planes, at the beginning.
    pub space_only: f64,
    /// Step of the space-time planes, at the beginning.
    pub space_time: f64,
    /// Whether the steps are learned.
    pub adaptive: bool,
    /// Iteration of the fine stage from which they are.
    pub adaptive_from: usize,
    /// Whether learned steps may become finer than they begin.
    pub refine: bool,
    /// Whether every scale has its own pair.
    pub per_scale: bool,
    /// Learning rate of the steps' logarithms.
    pub learning_rate: f64,
    /// Of a scene that was trained without a rate: how much PSNR the steps may cost, in dB; 0 takes the steps as they stand.
    pub search_tolerance: f64,
}

/// The model of the spherical harmonics beyond degree 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ShConfig {
    /// Which model.
    pub model: ShModel,
    /// Quantization step.
    pub step: f64,
    /// Learning rate of the model at the first step.
    pub learning_rate_init: f64,
    /// Learning rate of the model at the end of the fine stage.
    pub learning_rate_final: f64,
    /// Of a scene that was trained without a rate: how much PSNR the step may cost, in dB; 0 takes the step as it stands.
    pub search_tolerance: f64,
}

/// The entropy model of the spherical harmonics: one of [`ShKind::NAMES`] in TOML. Which there are is said in the model crate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShModel(pub ShKind);

impl fmt::Display for ShModel {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.0.name())
    }
}

impl FromStr for ShModel {
    type Err = UnknownChoice;

    fn from_str(name: &str) -> Result<Self, UnknownChoice> {
        ShKind::by_name(name).map(Self).ok_or_else(|| UnknownChoice::new("model", name, &ShKind::NAMES))
    }
}

impl Serialize for ShModel {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.name())
    }
}

impl<'de> Deserialize<'de> for ShModel {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

/// Quantization of what every Gaussian has besides spherical harmonics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct AttributesConfig {
    /// Step of the positions, as a share of the size of the typical Gaussian.
    pub position: f32,
    /// Step of the logarithms of scales.
    pub log_scale: f32,
    /// Step of the quaternions' components.
    pub quaternion: f32,
    /// Step of the opacity logits.
    pub opacity_logit: f32,
    /// Step of the degree-0 spherical harmonics.
    pub sh_dc: f32,
    /// Loss of training PSNR in dB that the search for coarser steps may cost; 0 = the steps as they stand.
    pub search_tolerance: f64,
}

impl AttributesConfig {
    /// The steps, as the codec has them.
    pub fn steps(&self) -> AttributeSteps {
        let Self { position, log_scale, quaternion, opacity_logit, sh_dc, search_tolerance: _ } = *self;
        let steps = AttributeSteps::default().with("means", position).with("log_scales", log_scale);
        steps.with("quats", quaternion).with("opacity_logits", opacity_logit).with("sh_dc", sh_dc)
    }
}

/// Bits a weight may have.
pub(super) const LEAST_WEIGHT_BITS: u8 = 4;
/// Bits a weight may have.
pub(super) const MOST_WEIGHT_BITS: u8 = 16;

/// Quantization of network weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WeightsConfig {
    /// Bits a weight of the deformation network.
    pub deformation_bits: u8,
    /// Bits a weight of the context model and of spherical-harmonics networks.
    pub context_bits: u8,
}

impl Default for CompressionConfig {
    fn default() -> Self {
        Self {
            profile: FileProfile::Compact,
            rate: RateConfig::default(),
            context: ContextConfig::default(),
            steps: StepsConfig::default(),
            sh: ShConfig::default(),
            attributes: AttributesConfig::default(),
            weights: WeightsConfig::default(),
        }
    }
}

impl Default for RateConfig {
    fn default() -> Self {
        Self {
            lambda: 0.0,
            weighting: RateWeighting::Megabytes,
            planes: true,
            sh: true,
            interval: 3,
            fraction: 0.125,
            from: 1000,
            planes_until: 27_000,
        }
    }
}

impl Default for ContextConfig {
    fn default() -> Self {
        Self {
            architecture: ContextArchitecture::Compact,
            hyperprior: true,
            checkerboard: true,
            inter_plane: true,
            inter_scale: true,
            high_scale_hyperprior: false,
            learning_rate_init: 5e-3,
            learning_rate_final: 5e-4,
            fit_iterations: 1500,
        }
    }
}

impl Default for StepsConfig {
    fn default() -> Self {
        let AdaptiveQuantizationConfig { space_only, space_time, per_scale, .. } = AdaptiveQuantizationConfig::new(1);
        Self {
            space_only,
            space_time,
            adaptive: true,
            adaptive_from: 15_000,
            refine: false,
            per_scale,
            learning_rate: 2e-3,
            search_tolerance: 0.0,
        }
    }
}

impl Default for ShConfig {
    fn default() -> Self {
        Self {
            model: ShModel(ShKind::Factorized),
            step: 0.02,
            learning_rate_init: 5e-3,
            learning_rate_final: 5e-4,
            search_tolerance: 0.0,
        }
    }
}

impl Default for AttributesConfig {
    fn default() -> Self {
        let steps = AttributeSteps::default();
        let step = |name| steps.of(name).unwrap_or(1.0);
        Self {
            position: step("means"),
            log_scale: step("log_scales"),
            quaternion: step("quats"),
            opacity_logit: step("opacity_logits"),
            sh_dc: step("sh_dc"),
            search_tolerance: 0.05,
        }
    }
}

impl Default for WeightsConfig {
    fn default() -> Self {
        let WeightPrecisions { motion, context_model, .. } = WeightPrecisions::default();
        let bits = |precision| match precision {
            WeightPrecision::Bits(bits) => bits,
            // The configuration knows bits only; so many lose nothing that matters.
            WeightPrecision::Step(_) => MOST_WEIGHT_BITS,
        };
        Self { deformation_bits: bits(motion), context_bits: bits(context_model) }
    }
}
