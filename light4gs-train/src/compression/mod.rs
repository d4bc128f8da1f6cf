//! What a scene is compressed with, and the rate that this puts into the loss (paper III-C to III-E).
//!
//! - here: the entropy models and the quantization steps that are trained beside a scene
//! - `rate`: noise in place of rounding, and the estimated size of the file
//! - `fit`: models for a scene that was trained without them
//! - `encoder`: a scene and its models into the bytes of a file
//! - `code_scene`: from a trained scene to a file, with a record of what was expected and what came out
//! - `step_search`: how coarsely the other attributes may be quantized
//! - `frozen_steps`: how coarsely planes and harmonics may be that never saw noise in training

mod code_scene;
mod encoder;
mod fit;
mod frozen_steps;
mod rate;
mod step_search;

pub use code_scene::{ASSUMED_PSNR, CodedPart, CodedScene, CodingRecord, PlaneRecord, TrainedScene, code_scene};
pub use encoder::{
    BitEstimate, BitMap, CodedSizes, EncodedScene, SearchImages, compression_input, encode, freeze_planes,
};
pub use fit::fit;
pub use rate::{NoisyScene, Rate};

use burn::module::Module;
use burn::tensor::Device;
use light4gs_model::{
    AdaptiveQuantization, AdaptiveQuantizationConfig, ContextModel, ContextModelConfig, ContextParts, HexPlane,
    ShEntropyModel,
};

use crate::config::{CompressionConfig, Config, ContextArchitecture, ContextConfig};
use crate::error::TrainError;

/// Entropy models and quantization steps of one scene.
#[derive(Module, Debug)]
pub struct Compression {
    /// Of the feature planes, if the deformation field has some.
    pub planes: Option<PlaneModels>,
    /// Of the spherical harmonics beyond degree 0; the models are made for degree 3. Lower degrees are coded with the
    /// frequencies of their symbols, and have no part in the rate.
    pub sh: Option<ShEntropyModel>,
}

/// What feature planes are coded with.
#[derive(Module, Debug)]
pub struct PlaneModels {
    /// What every value costs.
    pub context: ContextModel,
    /// How coarsely they are rounded.
    pub quantization: AdaptiveQuantization,
}

impl Compression {
    /// Untrained models, if the run trains them: if there is a rate in its loss.
    ///
    /// # Errors
    /// As [`Compression::new`].
    pub fn of_run(config: &Config, planes: Option<&HexPlane>, device: &Device) -> Result<Option<Self>, TrainError> {
        if config.compression.rate.lambda > 0.0 { Self::new(config, planes, device).map(Some) } else { Ok(None) }
    }

    /// Untrained models for scenes of a configuration, whose deformation field has these planes.
    ///
    /// # Errors
    /// [`TrainError::Input`] if the model of the spherical harmonics looks at planes and there are none.
    pub fn new(config: &Config, planes: Option<&HexPlane>, device: &Device) -> Result<Self, TrainError> {
        let CompressionConfig { context, sh, .. } = &config.compression;
        let feature_size = planes.map_or(0, HexPlane::feature_size);
        if sh.model.0.needs_planes() && feature_size == 0 {
            return Err(TrainError::Input(format!(
                "compression.sh.model = \"{}\" needs a deformation field with feature planes; choose another model",
                sh.model
            )));
        }
        let models = |planes: &HexPlane| PlaneModels {
            context: context_config(context, planes.feature_size() / planes.scales()).init(device),
            quantization: quantization_config(config, planes.scales()).init(device),
        };
        Ok(Self {
            planes: planes.map(models),
            sh: (config.model.sh_degree == 3).then(|| sh.model.0.config(sh.step as f32, feature_size).init(device)),
        })
    }

    /// Lets the context model begin with the statistics of planes.
    pub fn start_from(&mut self, planes: Option<&HexPlane>) {
        if let (Some(models), Some(planes)) = (&mut self.planes, planes) {
            models.context.start_from(&planes.tensors(), &models.quantization.steps_without_gradient());
        }
    }

    /// Keeps learned steps in the range that a configuration allows, for planes at so many scales.
    pub fn bound_steps(&mut self, config: &Config, scales: usize) {
        if let Some(models) = &mut self.planes
            && !config.compression.steps.refine
        {
            models.quantization.no_finer_than(&quantization_config(config, scales));
        }
    }
}

fn quantization_config(config: &Config, scales: usize) -> AdaptiveQuantizationConfig {
    let steps = &config.compression.steps;
    AdaptiveQuantizationConfig::new(scales)
        .with_space_only(steps.space_only)
        .with_space_time(steps.space_time)
        .with_per_scale(steps.per_scale)
}

fn context_config(config: &ContextConfig, channels: usize) -> ContextModelConfig {
    let sizes = match config.architecture {
        // The composition is what the switches say; the reference's centers and start belong to its sizes.
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
