//! The choice of a run's entropy models: those that its configuration names, or models from another crate.

use std::fmt::Debug;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::Device;
use light4gs_model::{ContextConfig, ContextModel, PlaneEntropy, ShConfig, ShEntropy, ShEntropyModel};

use crate::error::TrainError;

/// Makes the entropy models that a run trains beside its scene, and codes it with.
///
/// [`ConfiguredModels`] makes what the configuration describes. Models of your own are given to a trainer by
/// [`TrainerBuilder::entropy_models`](crate::trainer::TrainerBuilder::entropy_models), and are then used in the rate,
/// in checkpoints and in coding. Whenever a checkpoint is read, a model is made again, with the same structure.
pub trait EntropyModels: Debug + 'static {
    /// Of the feature planes.
    type Planes: PlaneEntropy;
    /// Of the spherical harmonics beyond degree 0.
    type Sh: ShModel;

    /// An untrained model of planes with this number of channels.
    ///
    /// # Errors
    /// [`TrainError::Input`] if there is no such model.
    fn planes(&self, settings: &ContextConfig, channels: usize, device: &Device) -> Result<Self::Planes, TrainError>;

    /// An untrained model of the spherical harmonics, beside planes with features of this length (0 without planes).
    ///
    /// # Errors
    /// [`TrainError::Input`] if there is no such model, for example because there are no planes.
    fn sh(&self, settings: &ShConfig, feature_size: usize, device: &Device) -> Result<Self::Sh, TrainError>;
}

/// A Burn module that is an entropy model of the spherical harmonics.
pub trait ShModel: ShEntropy + Module + ModuleDisplay + 'static {}

impl<T: ShEntropy + Module + ModuleDisplay + 'static> ShModel for T {}

/// The models that the configuration names.
#[derive(Clone, Copy, Debug, Default)]
pub struct ConfiguredModels;

impl EntropyModels for ConfiguredModels {
    type Planes = ContextModel;
    type Sh = ShEntropyModel;

    fn planes(&self, settings: &ContextConfig, channels: usize, device: &Device) -> Result<ContextModel, TrainError> {
        Ok(settings.model(channels).init(device))
    }

    fn sh(&self, settings: &ShConfig, feature_size: usize, device: &Device) -> Result<ShEntropyModel, TrainError> {
        if settings.model.needs_planes() && feature_size == 0 {
            return Err(TrainError::Input(format!(
                "compression.sh.model = \"{}\" needs a deformation field with feature planes; choose another model",
                settings.model
            )));
        }
        Ok(settings.model(feature_size).init(device))
    }
}

#[cfg(test)]
mod tests {
    use burn::module::Param;
    use burn::tensor::{Device, Tensor};
    use light4gs_data::PointCloud;
    use light4gs_model::attributes::attribute_of_path;
    use light4gs_model::parameters::{ParameterVisitor, visit_parameters};

    use super::ConfiguredModels;
    use crate::compression::Compression;
    use crate::config::Config;
    use crate::optimization::parameters::{COMPRESSION, ParameterGroup};

    #[derive(Default)]
    struct Groups(Vec<(String, Option<ParameterGroup>)>);

    impl ParameterVisitor for Groups {
        fn visit<const D: usize>(&mut self, path: &str, _: &Param<Tensor<D>>) {
            self.0.push((path.to_owned(), ParameterGroup::of(path)));
        }
    }

    /// Every trained parameter has a group; parameters without a group are constants.
    #[test]
    fn every_parameter_has_its_group() {
        let mut config = Config::default();
        config.model.fields.hexplane.hexplane.channels = 2;
        config.model.fields.hexplane.hexplane.resolution = [8, 8, 8, 4];
        let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.5, 2.0]], colors: vec![[0.5; 3]; 2] };
        let device = Device::flex();
        let scene = config.model.build().init(&cloud, &device);
        let compression = Compression::new(&ConfiguredModels, &config, scene.planes(), &device).unwrap();
        let (mut groups, mut models) = (Groups::default(), Groups::default());
        visit_parameters(&scene, &mut groups);
        visit_parameters(&compression, &mut models);
        for (path, group) in &groups.0 {
            assert_eq!(group.is_none(), path.starts_with("coordinates."), "{path}");
            let part = path.split('.').next().unwrap();
            assert_eq!(part == "gaussians", attribute_of_path(path).is_some(), "{path}");
        }
        for attribute in scene.gaussians.attributes() {
            assert!(groups.0.iter().any(|(path, _)| *path == attribute.path()), "{attribute:?}");
        }
        let planes = groups.0.iter().filter(|(_, group)| *group == Some(ParameterGroup::Planes)).count();
        assert_eq!(planes, 12);
        for (path, _) in models.0 {
            let path = format!("{COMPRESSION}.{path}");
            assert!(ParameterGroup::of(&path).is_some(), "{path}");
        }
        assert_eq!(ParameterGroup::of("field.motion.planes.0"), Some(ParameterGroup::Planes));
        assert_eq!(ParameterGroup::of("fields"), None);
    }
}
