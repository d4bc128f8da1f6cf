//! Learning-rate groups: which parameters share a rate, determined by their paths.
//!
//! Paths are those of [`light4gs_model::parameters`], with the prefix [`COMPRESSION`] for the entropy models.

/// Prefix of the paths of entropy models and quantization steps.
pub const COMPRESSION: &str = "compression";

/// Parameters that share a learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterGroup {
    /// Attributes of the Gaussians; each has a rate of its own.
    Attribute,
    /// Feature planes of the deformation field.
    Planes,
    /// Everything else of the deformation field.
    Deformation,
    /// The entropy model of the planes.
    Context,
    /// The entropy models of the spherical harmonics and of the other attributes.
    ShModel,
    /// Logarithms of learned quantization steps.
    Steps,
}

/// Beginning of a path, a name that must occur later in it (or nothing), and the group. The first matching line
/// decides. Parameters without a match, such as the scene's coordinates, are not trained.
const GROUPS: [(&str, &str, ParameterGroup); 9] = [
    ("gaussians", "", ParameterGroup::Attribute),
    // The planes of any field: `field.hexplane.planes.3` for the built-in one.
    ("field", "planes", ParameterGroup::Planes),
    ("field", "", ParameterGroup::Deformation),
    ("compression.planes.context", "", ParameterGroup::Context),
    ("compression.planes.quantization", "", ParameterGroup::Steps),
    ("compression.sh", "", ParameterGroup::ShModel),
    ("compression.attributes.log_steps", "", ParameterGroup::Steps),
    ("compression.attributes.mixture", "", ParameterGroup::ShModel),
    ("compression.attributes.prediction", "", ParameterGroup::ShModel),
];

impl ParameterGroup {
    /// The group of a parameter; `None` for constants.
    pub fn of(path: &str) -> Option<Self> {
        let fits = |(beginning, name, _): &&(&str, &str, Self)| {
            path.strip_prefix(beginning)
                .filter(|rest| rest.is_empty() || rest.starts_with('.'))
                .is_some_and(|rest| name.is_empty() || rest.split('.').any(|part| part == *name))
        };
        GROUPS.iter().find(fits).map(|(_, _, group)| *group)
    }
}
