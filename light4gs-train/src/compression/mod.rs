//! What a scene is compressed with, and the rate that this puts into the loss (paper III-C to III-E).
//!
//! - here: the entropy models and the quantisation steps that are trained beside a scene
//! - `rate`: noise in place of rounding, and the estimated size of the file
//! - `fit`: models for a scene that was trained without them
//! - `encoder`: a scene and its models into the bytes of a file
//! - `code_scene`: from a trained scene to a file, with a record of what was expected and what came out
//! - `step_search`: how coarsely the other attributes may be quantised

mod code_scene;
mod encoder;
mod fit;
mod rate;
mod step_search;

pub use code_scene::{CodedScene, CodingRecord, PlaneRecord, TrainedScene, code_scene};
pub use encoder::{BitEstimate, BitMap, CodedSizes, EncodedScene, Pictures, compression_input, encode, freeze_planes};
pub use fit::fit;
pub use rate::{NoisyScene, Rate};

use burn::tensor::Device;
use light4gs_model::{
    AdaptiveQuantization, AdaptiveQuantizationConfig, ContextModel, ContextModelConfig, ContextParts,
    ShAutoregressiveConfig, ShBottleneckConfig, ShEntropyConfig, ShEntropyModel, ShHexPlaneCoupledConfig,
    ShMixtureConfig,
};

use crate::config::{CompressionConfig, Config, ContextArchitecture, ContextConfig, ShConfig, ShModel};

/// Entropy models and quantisation steps of one scene.
#[derive(Clone, Debug)]
pub struct Compression {
    /// Of the hexplanes.
    pub context: ContextModel,
    /// Of the hexplanes.
    pub quantization: AdaptiveQuantization,
    /// Of the spherical harmonics beyond degree 0; the models are made for degree 3. Lower degrees are coded with the
    /// frequencies of their symbols, and have no part in the rate.
    pub sh: Option<ShEntropyModel>,
}

impl Compression {
    /// Untrained models, if the run trains them: if there is a rate in its loss.
    pub fn of_run(config: &Config, device: &Device) -> Option<Self> {
        (config.compression.rate.lambda > 0.0).then(|| Self::new(config, device))
    }

    /// Untrained models for scenes of a configuration.
    pub fn new(config: &Config, device: &Device) -> Self {
        let CompressionConfig { context, sh, .. } = &config.compression;
        let planes = &config.model.hexplane;
        let scales = planes.multipliers.len();
        Self {
            context: context_config(context, planes.channels).init(device),
            quantization: quantization_config(config).init(device),
            sh: (config.model.sh_degree == 3).then(|| sh_config(sh, planes.channels * scales).init(device)),
        }
    }

    /// Keeps learned steps in the range that a configuration allows.
    pub fn bound_steps(&mut self, config: &Config) {
        if !config.compression.steps.refine {
            self.quantization.no_finer_than(&quantization_config(config));
        }
    }
}

fn quantization_config(config: &Config) -> AdaptiveQuantizationConfig {
    let steps = &config.compression.steps;
    AdaptiveQuantizationConfig::new(config.model.hexplane.multipliers.len())
        .with_space_only(steps.space_only)
        .with_space_time(steps.space_time)
        .with_per_scale(steps.per_scale)
}

fn context_config(config: &ContextConfig, channels: usize) -> ContextModelConfig {
    let sizes = match config.architecture {
        // The composition is what the switches say; the reference's centres and start belong to its sizes.
        ContextArchitecture::Reference => ContextModelConfig::reference(channels),
        ContextArchitecture::Compact => ContextModelConfig::compact(channels),
    };
    let parts = ContextParts::new()
        .with_hyperprior(config.hyperprior)
        .with_checkerboard(config.checkerboard)
        .with_inter_plane(config.inter_plane)
        .with_inter_scale(config.inter_scale)
        .with_high_scale_hyperprior(config.high_scale_hyperprior);
    sizes.with_parts(parts)
}

/// Width of the densities of spherical harmonics before training, in the units of the values. The reference begins at 8,
/// and in its log the rate needs hundreds of iterations to come down from there; our runs are shorter.
const SH_INITIAL_SCALE: f64 = 0.3;

fn sh_config(config: &ShConfig, feature_size: usize) -> ShEntropyConfig {
    let step = config.step as f32;
    match config.model {
        ShModel::MixtureOfLogistics => ShEntropyConfig::Mixture(ShMixtureConfig::new().with_step(step)),
        ShModel::ChannelAutoregressive => {
            ShEntropyConfig::Autoregressive(ShAutoregressiveConfig::new().with_step(step))
        }
        ShModel::HexPlaneCoupled => {
            ShEntropyConfig::HexPlaneCoupled(ShHexPlaneCoupledConfig::new(feature_size).with_step(step))
        }
        ShModel::Factorized => {
            let bottleneck = ShBottleneckConfig::new().with_step(step).with_initial_scale(SH_INITIAL_SCALE);
            ShEntropyConfig::Factorized(bottleneck)
        }
    }
}
