//! How spherical harmonics are coded, as data.

use crate::{
    CodecError, FeaturePlaneArrays, FrequencyTable, GaussianArrays, Limits, Network, SceneCoordinateArrays,
    bytes::Section,
    limits::at_most,
    sh_rest_coefficients,
    steps::{LEAST_STEP_IN_STREAM, check_step},
};

pub(super) const SECTION: &str = Section::Sh.name();

/// How the spherical harmonics are coded.
#[derive(Clone, Debug, PartialEq)]
pub enum ShCoding {
    /// One distribution for each channel: the factorized bottleneck, and the mixture of logistics.
    Tables {
        /// Quantization step; a value is symbol times step.
        step: f32,
        /// `3 · ((degree + 1)² - 1)` tables.
        tables: Vec<FrequencyTable>,
    },
    /// Distributions that networks give for each Gaussian.
    Networks {
        /// Quantization step; a value is symbol plus mean, times step.
        step: f32,
        /// Each is for some channels, in the order of the channels. Together they are for all.
        priors: Vec<ShPrior>,
    },
    /// As other attributes: predicted from the Gaussians before, residuals coded adaptively, without a model in the file.
    Channels {
        /// Quantization step; a value is index times step.
        step: f32,
    },
}

/// Where the distributions of some channels come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShPrior {
    /// It is evaluated for one Gaussian at a time. Its one output is the scales of `C` channels, then their means, in
    /// units of the step: `2 C` channels.
    pub network: Network,
    /// What its inputs are.
    pub sources: Vec<ShSource>,
}

/// What the network of an [`ShPrior`] may read. All of it has been decoded before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShSource {
    /// The harmonics of degree 0: red, green, blue.
    Dc,
    /// The channels of the priors before this one.
    Decoded,
    /// For each scale and channel of the planes, the product of the samples of the space-only planes at the Gaussian's
    /// center.
    SpaceFeatures,
    /// The Gaussian's center in the planes' coordinates: x, y, z in [-1, 1].
    Position,
    /// Logarithms of the scales.
    LogScale,
    /// The rotation `(w, x, y, z)`.
    Quaternion,
    /// The opacity before the sigmoid.
    OpacityLogit,
}

impl ShSource {
    const ALL: [Self; 7] = [
        Self::Dc,
        Self::Decoded,
        Self::SpaceFeatures,
        Self::Position,
        Self::LogScale,
        Self::Quaternion,
        Self::OpacityLogit,
    ];

    pub(super) fn number(self) -> u64 {
        Self::ALL.iter().position(|&source| source == self).unwrap_or(0) as u64
    }

    pub(super) fn from_number(number: u64) -> Option<Self> {
        Self::ALL.get(usize::try_from(number).ok()?).copied()
    }

    /// Channels of this source. `features` is the length of a feature of the planes, `decoded` the number of channels decoded
    /// before.
    fn channels(self, features: u64, decoded: u64) -> u64 {
        match self {
            Self::Dc | Self::Position | Self::LogScale => 3,
            Self::Decoded => decoded,
            Self::SpaceFeatures => features,
            Self::Quaternion => 4,
            Self::OpacityLogit => 1,
        }
    }
}

/// What distributions may depend on: decoded Gaussians without `sh_rest`, the scene coordinates, decoded planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conditions<'a> {
    pub(crate) gaussians: &'a GaussianArrays,
    pub(crate) coordinates: &'a SceneCoordinateArrays,
    pub(crate) feature_planes: &'a FeaturePlaneArrays,
}

impl Conditions<'_> {
    /// Length of a feature.
    pub(super) fn features(&self) -> u64 {
        self.feature_planes.features()
    }
}

impl ShCoding {
    pub(crate) fn step(&self) -> f32 {
        match self {
            Self::Tables { step, .. } | Self::Networks { step, .. } | Self::Channels { step } => *step,
        }
    }

    /// Refuses a step, tables or networks that do not fit the degree or the features of the planes.
    pub(crate) fn check(&self, degree: u8, features: u64, limits: &Limits) -> Result<(), CodecError> {
        let step = self.step();
        if !(step.is_finite() && step >= LEAST_STEP_IN_STREAM) {
            return Err(CodecError::invalid(SECTION, "step", step, "a number of 2^-60 or more"));
        }
        let channels = 3 * sh_rest_coefficients(degree);
        match self {
            Self::Tables { tables, .. } => {
                if tables.len() != channels {
                    let expected = format!("{channels}, one a channel of degree {degree}");
                    return Err(CodecError::invalid(SECTION, "number of tables", tables.len(), expected));
                }
                Ok(())
            }
            Self::Channels { step } => check_step(SECTION, "step", *step, LEAST_STEP_IN_STREAM),
            Self::Networks { priors, .. } => {
                check_priors(priors, channels as u64, features, limits)?;
                for (index, prior) in priors.iter().enumerate() {
                    prior.network.check(SECTION, &prior_name(index), limits)?;
                }
                Ok(())
            }
        }
    }
}

pub(super) fn prior_name(index: usize) -> String {
    format!("priors[{index}]")
}

/// Refuses priors that do not cover all channels exactly once, or that read what does not exist. Weights are not
/// checked.
pub(super) fn check_priors(
    priors: &[ShPrior],
    channels: u64,
    features: u64,
    limits: &Limits,
) -> Result<(), CodecError> {
    at_most(SECTION, "number of priors", priors.len() as u64, limits.networks)?;
    let (mut decoded, mut weights) = (0u64, 0u64);
    for (index, ShPrior { network, sources }) in priors.iter().enumerate() {
        let name = prior_name(index);
        network.check_structure(SECTION, &name, limits)?;
        network.check_pointwise(SECTION, &name)?;
        if sources.len() != network.inputs.len() {
            let expected = format!("{}, one for each input of its network", network.inputs.len());
            return Err(CodecError::invalid(SECTION, format!("number of sources of {name}"), sources.len(), expected));
        }
        for (source, &found) in sources.iter().zip(&network.inputs) {
            let expected = source.channels(features, decoded);
            if u64::from(found) != expected {
                let field = format!("channels of an input of {name}");
                let expected = format!("{expected}, those of its source {source:?}");
                return Err(CodecError::invalid(SECTION, field, found, expected));
            }
        }
        let channels = network.channels();
        let outputs: Vec<u64> = network.outputs.iter().map(|value| channels[value.0 as usize]).collect();
        let own = match outputs[..] {
            [own] if own.is_multiple_of(2) => own / 2,
            _ => {
                let (found, expected) = (format!("{outputs:?} channels"), "one, of as many scales as means");
                return Err(CodecError::invalid(SECTION, format!("outputs of {name}"), found, expected));
            }
        };
        decoded += own;
        weights = weights.saturating_add(network.weights());
    }
    at_most(SECTION, "number of weights", weights, limits.layer_weights)?;
    if decoded != channels {
        let expected = format!("{channels}, those of the harmonics");
        return Err(CodecError::invalid(SECTION, "channels of all priors", decoded, expected));
    }
    Ok(())
}
