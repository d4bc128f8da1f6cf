//! How the Gaussians move, as data.

use super::{FurtherAttribute, GaussianArrays, SceneData};
use crate::{
    CodecError, Limits, Network,
    bytes::{Section, names::check_name},
    limits::at_most,
};

const SECTION: &str = Section::Motion.name();
/// The longest name of a kind.
const LONGEST_KIND: usize = 64;

/// How the Gaussians move.
///
/// This crate runs any [`MotionNetwork`]. `kind` tells a program which deformation field to make from these arrays.
/// Arrays of an unknown kind can still be decoded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionArrays {
    /// The name of the deformation field, such as `hexplane`: at most 64 lower-case letters, digits, `-`, `_` and `.`;
    /// empty where nothing moves.
    pub kind: String,
    /// The network that moves each Gaussian, if there is one.
    pub network: Option<MotionNetwork>,
    /// Further parameters of the field. The built-in fields have none.
    pub tensors: Vec<NamedTensor>,
}

/// A network that gives the attributes of one Gaussian at a time, or offsets of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionNetwork {
    /// It is evaluated for one Gaussian at a time.
    pub network: Network,
    /// What its inputs are.
    pub sources: Vec<MotionSource>,
    /// What its outputs are; each attribute at most once.
    pub outputs: Vec<MotionOutput>,
}

/// What a [`MotionNetwork`] may read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MotionSource {
    /// For each scale and channel of the planes, the product of their samples at the Gaussian's canonical center and
    /// the time.
    Features,
    /// The canonical center in the planes' coordinates: x, y, z in [-1, 1].
    Point,
    /// The time in [0, 1].
    Time,
    /// An attribute of the canonical Gaussian by its name in [`crate::GaussianArrays::attributes`], as it is stored
    /// there: `means` (3, in world units), `log_scales` (3), `quats` (4), `opacity_logits` (1), `sh_dc` (3), `sh_rest`,
    /// and further attributes of the scene.
    Attribute(String),
}

/// The attribute that an output of a [`MotionNetwork`] is added to, or that it replaces. Canonical attributes are
/// those of [`crate::GaussianArrays`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionOutput {
    /// The center, 3 channels.
    Position,
    /// Logarithms of the scales, 3 channels.
    LogScale,
    /// The rotation before it is normalized, 4 channels.
    Quaternion,
    /// The opacity before the sigmoid, 1 channel.
    OpacityLogit,
    /// Spherical harmonics: for each coefficient, degree 0 included, red, green, blue. Coefficients that a scene does
    /// not have are ignored.
    Sh,
    /// As [`MotionOutput::Position`], in place of the canonical center.
    NewPosition,
    /// As [`MotionOutput::LogScale`], in place of the canonical ones.
    NewLogScale,
    /// As [`MotionOutput::Quaternion`], in place of the canonical one.
    NewQuaternion,
    /// As [`MotionOutput::OpacityLogit`], in place of the canonical one.
    NewOpacityLogit,
    /// As [`MotionOutput::Sh`], in place of the canonical ones.
    NewSh,
}

/// Numbers with a name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamedTensor {
    /// Unique among the tensors.
    pub name: String,
    /// Lengths of the axes.
    pub shape: Vec<u32>,
    /// Row-major.
    pub values: Vec<f32>,
}

impl NamedTensor {
    /// The number of values that follows from the shape.
    pub(crate) fn length(&self) -> u64 {
        self.shape.iter().fold(1, |length: u64, &side| length.saturating_mul(side.into()))
    }
}

impl MotionSource {
    /// Its number of channels, for planes with `features` features and these Gaussians; `None` if they have no such
    /// attribute.
    fn channels(&self, features: u64, gaussians: &GaussianArrays) -> Option<u64> {
        match self {
            Self::Features => Some(features),
            Self::Point => Some(3),
            Self::Time => Some(1),
            Self::Attribute(name) => gaussians.attribute(name).map(|attribute| attribute.width as u64),
        }
    }
}

impl MotionOutput {
    /// All, in the order of their numbers in a stream: first those that are added, then those that replace an
    /// attribute.
    pub(crate) const ALL: [Self; 10] = [
        Self::Position,
        Self::LogScale,
        Self::Quaternion,
        Self::OpacityLogit,
        Self::Sh,
        Self::NewPosition,
        Self::NewLogScale,
        Self::NewQuaternion,
        Self::NewOpacityLogit,
        Self::NewSh,
    ];

    /// The variant that is added to the same attribute.
    pub(crate) fn added(self) -> Self {
        Self::ALL[self as usize % (Self::ALL.len() / 2)]
    }

    /// Whether it replaces the attribute.
    pub(crate) fn replaces(self) -> bool {
        self as usize >= Self::ALL.len() / 2
    }

    fn has_channels(self, channels: u64) -> bool {
        match self.added() {
            Self::Position | Self::LogScale => channels == 3,
            Self::Quaternion => channels == 4,
            Self::OpacityLogit => channels == 1,
            _ => [1, 4, 9, 16].contains(&(channels / 3)) && channels.is_multiple_of(3),
        }
    }
}

impl MotionArrays {
    /// Its description: the same without weights and without the values of tensors.
    pub(crate) fn description(&self) -> Self {
        let bare = |motion: &MotionNetwork| MotionNetwork {
            network: motion.network.clone().without_weights(),
            sources: motion.sources.clone(),
            outputs: motion.outputs.clone(),
        };
        let tensor = |tensor: &NamedTensor| NamedTensor {
            name: tensor.name.clone(),
            shape: tensor.shape.clone(),
            values: Vec::new(),
        };
        Self {
            kind: self.kind.clone(),
            network: self.network.as_ref().map(bare),
            tensors: self.tensors.iter().map(tensor).collect(),
        }
    }

    /// Whether the meaning of an attribute is known: either the network reads it, or there is no network, and then only
    /// a program that knows the kind can show the scene.
    fn knows(&self, attribute: &str) -> bool {
        let is_read = |source: &MotionSource| matches!(source, MotionSource::Attribute(name) if name == attribute);
        match &self.network {
            Some(motion) => motion.sources.iter().any(is_read),
            None => !self.kind.is_empty(),
        }
    }

    /// Refuses arrays that contradict themselves.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), CodecError> {
        self.check_structure(limits)?;
        if let Some(MotionNetwork { network, .. }) = &self.network {
            network.check(SECTION, "the network", limits)?;
        }
        for tensor in &self.tensors {
            if tensor.values.len() as u64 != tensor.length() {
                let field = format!("length of {}", tensor.name);
                return Err(CodecError::invalid(SECTION, field, tensor.values.len(), format!("{:?}", tensor.shape)));
            }
        }
        Ok(())
    }

    /// [`MotionArrays::check`] without the numbers.
    pub(crate) fn check_structure(&self, limits: &Limits) -> Result<(), CodecError> {
        let legal = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"-_.".contains(&byte);
        let nothing = self.network.is_none() && self.tensors.is_empty();
        if self.kind.len() > LONGEST_KIND || !self.kind.bytes().all(legal) || self.kind.is_empty() != nothing {
            let expected = "at most 64 of a-z, 0-9, '-', '_', '.', and empty only where nothing moves";
            return Err(CodecError::invalid(SECTION, "kind", format!("{:?}", self.kind), expected));
        }
        if let Some(motion) = &self.network {
            motion.check_structure(limits)?;
        }
        at_most(SECTION, "number of tensors", self.tensors.len() as u64, limits.nodes)?;
        for (index, tensor) in self.tensors.iter().enumerate() {
            check_name(SECTION, "a tensor's name", &tensor.name, limits)?;
            at_most(SECTION, format!("axes of {}", tensor.name), tensor.shape.len() as u64, 8u32)?;
            if self.tensors[..index].iter().any(|other| other.name == tensor.name) {
                let found = format!("{:?} twice", tensor.name);
                return Err(CodecError::invalid(SECTION, "tensors", found, "each name once"));
            }
        }
        at_most(SECTION, "number of weights", self.weights(), limits.layer_weights)
    }

    /// Numbers of the network and of the tensors, as their shapes give them.
    pub(crate) fn weights(&self) -> u64 {
        let network = self.network.as_ref().map_or(0, |motion| motion.network.weights());
        self.tensors.iter().fold(network, |sum, tensor| sum.saturating_add(tensor.length()))
    }

    /// Refuses a network that reads a number of features other than that of the planes, or attributes that these
    /// Gaussians do not have.
    pub(crate) fn check_sources(&self, features: u64, gaussians: &GaussianArrays) -> Result<(), CodecError> {
        let Some(MotionNetwork { network, sources, .. }) = &self.network else { return Ok(()) };
        for (source, &found) in sources.iter().zip(&network.inputs) {
            let Some(expected) = source.channels(features, gaussians) else {
                let expected = "an attribute that the Gaussians have";
                return Err(CodecError::invalid(SECTION, "a source of the network", format!("{source:?}"), expected));
            };
            if u64::from(found) != expected {
                let field = format!("channels of the input that is {source:?}");
                return Err(CodecError::invalid(SECTION, field, found, expected.to_string()));
            }
        }
        Ok(())
    }
}

impl SceneData {
    /// Refuses to show a scene that would look wrong: one whose Gaussians have a further attribute that is not
    /// [optional](crate::FurtherAttribute::optional), and that the motion does not read. Such a scene can be decoded.
    ///
    /// # Errors
    /// [`CodecError::UnknownAttribute`] with the first such name.
    pub fn check_attributes_are_known(&self) -> Result<(), CodecError> {
        let unknown = |attribute: &&FurtherAttribute| !attribute.optional && !self.motion.knows(&attribute.name);
        match self.gaussians.further.iter().find(unknown) {
            None => Ok(()),
            Some(attribute) => Err(CodecError::UnknownAttribute { name: attribute.name.clone() }),
        }
    }
}

impl MotionNetwork {
    fn check_structure(&self, limits: &Limits) -> Result<(), CodecError> {
        let Self { network, sources, outputs } = self;
        network.check_structure(SECTION, "the network", limits)?;
        network.check_pointwise(SECTION, "the network")?;
        for (what, found, expected) in [
            ("number of sources", sources.len(), network.inputs.len()),
            ("number of named outputs", outputs.len(), network.outputs.len()),
        ] {
            if found != expected {
                return Err(CodecError::invalid(SECTION, what, found, format!("{expected}, as the network has")));
            }
        }
        for source in sources {
            if let MotionSource::Attribute(name) = source {
                check_name(SECTION, "an attribute's name", name, limits)?;
            }
        }
        let channels = network.channels();
        for (index, (output, value)) in outputs.iter().zip(&network.outputs).enumerate() {
            let found = channels[value.0 as usize];
            let again = outputs[..index].iter().any(|other| other.added() == output.added());
            if !output.has_channels(found) || again {
                let expected = "those of the attribute that it changes, each attribute once";
                return Err(CodecError::invalid(
                    SECTION,
                    format!("output {output:?}"),
                    format!("{found} channels"),
                    expected,
                ));
            }
        }
        Ok(())
    }
}
