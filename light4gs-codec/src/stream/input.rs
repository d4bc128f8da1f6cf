//! How a scene is to be compressed.

use super::GaussianLayers;
use crate::{
    CodecError, Limits, PlaneCoding, SceneData, ShCoding,
    attributes::{AttributeSteps, check_positions},
    network_weights::WeightPrecision,
    planes, steps,
};

/// Which parts of a compressed stream stay in full precision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Everything is quantized and entropy coded. Decoded Gaussians have another order.
    #[default]
    Compact,
    /// As in the paper: planes and spherical harmonics are entropy coded; the other attributes of the Gaussians and all
    /// network weights stay float32.
    Paper,
}

impl Profile {
    /// A name for display.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compact => "compact",
            Self::Paper => "paper",
        }
    }
}

/// How [`crate::encode_compressed`] codes a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct CompressionInput {
    /// Which parts stay in full precision.
    pub profile: Profile,
    /// The coding of the planes; `None` writes them as float32.
    pub planes: Option<PlaneCoding>,
    /// The coding of the spherical harmonics beyond degree 0.
    pub sh: ShCoding,
    /// The steps of the other attributes of the Gaussians, in the compact profile.
    pub attributes: AttributeSteps,
    /// The precision of weights, in the compact profile.
    pub weights: WeightPrecisions,
    /// The layers into which the Gaussians are divided, for files that are shown while they come.
    pub layers: GaussianLayers,
}

impl CompressionInput {
    /// Refuses what [`crate::encode_compressed`] refuses before it codes the first number.
    pub(crate) fn check(&self, scene: &SceneData, limits: &Limits) -> Result<(), CodecError> {
        super::check(scene, limits)?;
        let Self { profile, planes, sh, attributes, weights, layers } = self;
        layers.check(scene.gaussians.len())?;
        if *profile == Profile::Compact {
            check_positions(&scene.gaussians.means)?;
            attributes.check()?;
            for precision in [weights.motion, weights.context_model, weights.sh] {
                precision.check()?;
            }
        }
        if let Some(coding) = planes {
            planes::section::check(&scene.feature_planes, coding, limits)?;
        }
        check_sh(scene, sh, limits)
    }

    /// A precision of weights, where the profile quantizes weights.
    pub(super) fn precision(&self, precision: WeightPrecision) -> Option<WeightPrecision> {
        (self.profile == Profile::Compact).then_some(precision)
    }
}

/// Refuses a coding of the harmonics that contradicts itself or the scene.
pub(super) fn check_sh(scene: &SceneData, sh: &ShCoding, limits: &Limits) -> Result<(), CodecError> {
    steps::sh_step(sh.step())?;
    sh.check(scene.gaussians.sh_degree, scene.feature_planes.features(), limits)
}

/// The precision of the weights of each kind of network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightPrecisions {
    /// Those of the motion, whose errors change the image.
    pub motion: WeightPrecision,
    /// Those of the context model, whose errors only cost bits.
    pub context_model: WeightPrecision,
    /// Those of the networks of the spherical harmonics, whose errors only cost bits.
    pub sh: WeightPrecision,
}

impl Default for WeightPrecisions {
    fn default() -> Self {
        let [motion, context_model, sh] = [10, 8, 8].map(WeightPrecision::Bits);
        Self { motion, context_model, sh }
    }
}
