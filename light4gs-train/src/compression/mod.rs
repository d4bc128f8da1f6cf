//! The entropy models of a scene, and the rate in the loss that follows from them (paper III-C to III-E).
//!
//! | task | use |
//! |---|---|
//! | make the file of a trained scene | [`code_scene`], or `Trainer::encode`, which calls it |
//! | make the file with models and steps at hand, without a configuration of a run | [`encode`] |
//! | put the rate into a loss of your own | [`Compression::noisy`], then [`Compression::rate`] |
//! | train models of your own | [`EntropyModels`] |
//! | fit models to a scene that was trained without them | [`fit`](fn@fit) |
//!
//! The files:
//!
//! - this file: the entropy models and the quantization steps that are trained beside a scene
//! - `models`: the choice of entropy models
//! - `rate`: noise in place of rounding, and the estimated size of the file
//! - `fit`: models for a scene that was trained without them
//! - `encoder`: from a scene and its models to the bytes of a file
//! - `code_scene`: from a trained scene to a file, with a record of expected and written bits
//! - `attribute_bits`: expected and written bits of each attribute; corrects the first by the second
//! - `attribute_step_search`: the coarsest steps of the other attributes
//! - `plane_and_sh_step_search`: the coarsest steps of planes and harmonics that were trained without noise
//! - `step_factor`, `quality`: a file of a wished size or quality, and the measurement of the quality

mod attribute_bits;
mod attribute_step_search;
mod code_scene;
mod encoder;
mod fit;
mod models;
mod plane_and_sh_step_search;
mod quality;
mod rate;
mod step_factor;

pub use attribute_bits::AttributeRecord;
pub use code_scene::{ASSUMED_PSNR, CodedPart, CodedScene, CodingRecord, PlaneRecord, TrainedScene, code_scene};
pub use encoder::{
    BitEstimate, BitMap, EncodedScene, SearchImages, compression_input, encode, encoded_so_far, freeze_planes,
};
pub use fit::fit;
pub use models::{ConfiguredModels, EntropyModels, ShModel};
pub use quality::{mean_psnr, measured_views, splatter_of};
pub(crate) use rate::BITS_A_MEGABYTE;
pub use rate::{Estimate, NoisyScene, Rate};
pub use step_factor::MissedQuality;

use burn::module::Module;
use burn::tensor::Device;
use light4gs_model::attributes::Coding;
use light4gs_model::{
    AdaptiveQuantization, Attribute, AttributeEntropy, CodedAttribute, ContextModel, DeformationField, DynamicScene,
    FeaturePlanes, Gaussians, PlaneEntropy, ShEntropyModel,
};

use crate::config::{CompressionConfig, Config};
use crate::error::TrainError;

/// Entropy models and quantization steps of one scene.
#[derive(Module, Debug)]
pub struct Compression<C: Module = ContextModel, S: Module = ShEntropyModel> {
    /// Those of the feature planes, if the deformation field has any.
    pub planes: Option<PlaneModels<C>>,
    /// That of the spherical harmonics beyond degree 0; models are made for degree 3. Lower degrees have
    /// none; in the rate they are among the attributes.
    pub sh: Option<S>,
    /// That of the other attributes of the Gaussians, if the rate includes them.
    pub attributes: Option<AttributeEntropy>,
}

/// The entropy model and the steps of feature planes.
#[derive(Module, Debug)]
pub struct PlaneModels<C: Module = ContextModel> {
    /// The bits of every value.
    pub context: C,
    /// The quantization steps.
    pub quantization: AdaptiveQuantization,
}

/// The entropy models and quantization steps that an implementation of [`EntropyModels`] makes.
pub type CompressionOf<E> = Compression<<E as EntropyModels>::Planes, <E as EntropyModels>::Sh>;

impl<C: PlaneEntropy, S: ShModel> Compression<C, S> {
    /// Untrained models if the run trains them, that is, if its loss has a rate.
    ///
    /// # Errors
    /// As [`Compression::new`].
    pub fn of_run<E: EntropyModels<Planes = C, Sh = S>>(
        models: &E,
        config: &Config,
        scene: &DynamicScene<impl DeformationField>,
        device: &Device,
    ) -> Result<Option<Self>, TrainError> {
        if config.compression.rate.lambda <= 0.0 {
            return Ok(None);
        }
        let mut compression = Self::new(models, config, scene.planes(), device)?;
        if config.compression.rate.attributes {
            let coded = coded_attributes(config, &scene.gaussians, compression.sh.is_some());
            compression.attributes = Some(AttributeEntropy::new(coded, device));
        }
        Ok(Some(compression))
    }

    /// Untrained models for scenes of a configuration whose deformation field has these planes, without one of the
    /// attributes: it can only be trained with the scene.
    ///
    /// # Errors
    /// [`TrainError::Input`] if there is no such model, for example if the model of the spherical harmonics reads
    /// planes and there are none.
    pub fn new<E: EntropyModels<Planes = C, Sh = S>>(
        models: &E,
        config: &Config,
        planes: Option<&FeaturePlanes>,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let CompressionConfig { context, sh, .. } = &config.compression;
        let feature_size = planes.map_or(0, FeaturePlanes::feature_size);
        let plane_models = |planes: &FeaturePlanes| -> Result<_, TrainError> {
            Ok(PlaneModels {
                context: models.planes(&context.model, planes.channels(), device)?,
                quantization: config.compression.steps.initial.init(planes.layout(), device),
            })
        };
        let planes = planes.map(plane_models).transpose()?;
        let sh = (config.model.sh_degree == 3).then(|| models.sh(&sh.entropy, feature_size, device)).transpose()?;
        Ok(Self { planes, sh, attributes: None })
    }

    /// Initializes the context model with the statistics of planes.
    pub fn start_from(&mut self, planes: Option<&FeaturePlanes>) {
        if let (Some(models), Some(planes)) = (&mut self.planes, planes) {
            models.context.base_mut().start_from(&planes.tensors(), &models.quantization.steps_without_gradient());
        }
    }

    /// Initializes the model of the attributes with the values of Gaussians.
    pub fn start_attributes_from(&mut self, gaussians: &Gaussians) {
        if let Some(attributes) = &mut self.attributes {
            attributes.start_from(&gaussians.tensors());
        }
    }

    /// The model of the attributes once it has learned anything: a scene of an earlier iteration is coded without it.
    pub(crate) fn learned_attributes(&self) -> Option<&AttributeEntropy> {
        self.attributes.as_ref().filter(|attributes| attributes.is_started())
    }

    /// Keeps learned steps from becoming finer than a configuration begins with, as finer ones help training frames only, and coarser
    /// than the encoder takes.
    pub fn bound_steps(&mut self, config: &Config) {
        if let Some(models) = &mut self.planes {
            models.quantization.no_finer_than(&config.compression.steps.initial);
        }
    }
}

/// The attributes of Gaussians whose steps are learned: those that are quantized, and show in an image. Spherical
/// harmonics are among them unless they have a model of their own.
fn coded_attributes(config: &Config, gaussians: &Gaussians, sh_has_model: bool) -> Vec<CodedAttribute> {
    let coded = |attribute: &Attribute| {
        let width = attribute.width.of(gaussians.sh_degree());
        let step = match attribute.coding {
            Coding::Harmonics if sh_has_model || width == 0 => None,
            Coding::Harmonics => Some(config.compression.sh.entropy.step as f32),
            Coding::Quantized(_) | Coding::Float32 => config.compression.attributes.step(attribute),
        };
        step.map(|step| CodedAttribute { name: attribute.name.to_string(), width, step })
    };
    gaussians.attributes().filter(|attribute| !attribute.optional).filter_map(coded).collect()
}
