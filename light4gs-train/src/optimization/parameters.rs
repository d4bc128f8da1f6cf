//! Learning-rate groups: which parameters share a rate, by their paths.
//!
//! Paths are those of [`light4gs_model::parameters`], with [`COMPRESSION`] in front of those of the entropy models.

/// What stands in front of the paths of entropy models and quantization steps.
pub const COMPRESSION: &str = "compression";

/// Parameters that share a learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterGroup {
    /// What every Gaussian has; each attribute has a rate of its own.
    Attribute,
    /// Feature planes of the deformation field.
    Planes,
    /// Everything else of the deformation field.
    Deformation,
    /// The entropy model of the planes.
    Context,
    /// The entropy model of the spherical harmonics.
    ShModel,
    /// Logarithms of the planes' quantization steps.
    Steps,
}

/// Beginning of a path, a name that must follow somewhere in it (or nothing), and the group. The first line that fits
/// counts. What fits none, such as the scene's coordinates, is not trained.
const GROUPS: [(&str, &str, ParameterGroup); 6] = [
    ("gaussians", "", ParameterGroup::Attribute),
    // The planes of any field: `field.hexplane.planes.3` for the built-in one.
    ("field", "planes", ParameterGroup::Planes),
    ("field", "", ParameterGroup::Deformation),
    ("compression.planes.context", "", ParameterGroup::Context),
    ("compression.planes.quantization", "", ParameterGroup::Steps),
    ("compression.sh", "", ParameterGroup::ShModel),
];

impl ParameterGroup {
    /// The group of a parameter. None for constants.
    pub fn of(path: &str) -> Option<Self> {
        let fits = |(beginning, name, _): &&(&str, &str, Self)| {
            path.strip_prefix(beginning)
                .filter(|rest| rest.is_empty() || rest.starts_with('.'))
                .is_some_and(|rest| name.is_empty() || rest.split('.').any(|part| part == *name))
        };
        GROUPS.iter().find(fits).map(|(_, _, group)| *group)
    }
}

#[cfg(test)]
mod tests {
    use burn::module::Param;
    use burn::tensor::{Device, Tensor};
    use light4gs_data::PointCloud;
    use light4gs_model::attributes::attribute_of_path;
    use light4gs_model::parameters::{ParameterVisitor, visit_parameters};

    use super::*;
    use crate::compression::{Compression, ConfiguredModels};
    use crate::config::Config;

    #[derive(Default)]
    struct Groups(Vec<(String, Option<ParameterGroup>)>);

    impl ParameterVisitor for Groups {
        fn visit<const D: usize>(&mut self, path: &str, _: &Param<Tensor<D>>) {
            self.0.push((path.to_owned(), ParameterGroup::of(path)));
        }
    }

    /// Whatever is trained has a group, whatever has none is a constant.
    #[test]
    fn every_parameter_has_its_group() {
        let mut config = Config::default();
        config.model.hexplane.channels = 2;
        config.model.hexplane.resolution = [8, 8, 8, 4];
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
