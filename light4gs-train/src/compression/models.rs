//! Which entropy models a run has: those that its configuration names, or models of one's own.

use std::fmt::Debug;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::Device;
use light4gs_model::{ContextModel, ContextModelConfig, ContextParts, PlaneEntropy, ShEntropy, ShEntropyModel};

use crate::config::{ContextArchitecture, ContextConfig, ShConfig};
use crate::error::TrainError;

/// Makes the entropy models that a run trains beside its scene, and codes it with.
///
/// [`ConfiguredModels`] makes what the configuration describes. Models of one's own are given to a trainer by
/// [`TrainerBuilder::entropy_models`](crate::trainer::TrainerBuilder::entropy_models); the rate in the loss, checkpoints
/// and coding are then theirs. A model is made anew, with the same structure, whenever a checkpoint is read.
pub trait EntropyModels: Debug + 'static {
    /// Of the feature planes.
    type Planes: PlaneEntropy;
    /// Of the spherical harmonics beyond degree 0.
    type Sh: ShModel;

    /// An untrained model of planes with so many channels.
    ///
    /// # Errors
    /// [`TrainError::Input`] where there is no such model.
    fn planes(&self, settings: &ContextConfig, channels: usize, device: &Device) -> Result<Self::Planes, TrainError>;

    /// An untrained model of the spherical harmonics, beside planes with features of this length (0 without planes).
    ///
    /// # Errors
    /// [`TrainError::Input`] where there is no such model, such as for want of planes.
    fn sh(&self, settings: &ShConfig, feature_size: usize, device: &Device) -> Result<Self::Sh, TrainError>;
}

/// A Burn module that is an entropy model of the spherical harmonics.
pub trait ShModel: ShEntropy + Module + ModuleDisplay + 'static {}

impl<T: ShEntropy + Module + ModuleDisplay + 'static> ShModel for T {}

/// The models that the configuration describes.
#[derive(Clone, Copy, Debug, Default)]
pub struct ConfiguredModels;

impl EntropyModels for ConfiguredModels {
    type Planes = ContextModel;
    type Sh = ShEntropyModel;

    fn planes(&self, settings: &ContextConfig, channels: usize, device: &Device) -> Result<ContextModel, TrainError> {
        Ok(context_model(settings, channels).init(device))
    }

    fn sh(&self, settings: &ShConfig, feature_size: usize, device: &Device) -> Result<ShEntropyModel, TrainError> {
        if settings.model.0.needs_planes() && feature_size == 0 {
            return Err(TrainError::Input(format!(
                "compression.sh.model = \"{}\" needs a deformation field with feature planes; choose another model",
                settings.model
            )));
        }
        Ok(settings.model.0.config(settings.step as f32, feature_size).init(device))
    }
}

/// The context model that a configuration describes, for planes with so many channels.
pub fn context_model(settings: &ContextConfig, channels: usize) -> ContextModelConfig {
    let sizes = match settings.architecture {
        // The composition is what the switches say; the reference's centers and start belong to its sizes.
        ContextArchitecture::Reference => ContextModelConfig::reference(channels),
        ContextArchitecture::Compact => ContextModelConfig::compact(channels),
    };
    let parts = ContextParts::new()
        .with_hyperprior(settings.hyperprior)
        .with_checkerboard(settings.checkerboard)
        .with_inter_plane(settings.inter_plane)
        .with_inter_scale(settings.inter_scale)
        .with_high_scale_hyperprior(settings.high_scale_hyperprior);
    sizes.with_parts(parts)
}
