//! How finely the attributes are quantised.

use super::SECTION;
use crate::{CodecError, adaptive::LARGEST_STEP};

/// How finely each attribute of a Gaussian is quantised.
///
/// Every step is the distance between two neighbouring levels, so an attribute is off by half of it at most. The
/// defaults are meant for scenes seen at 200 to 800 pixels, where they cost about 0.1 dB or less; halving a step costs
/// one bit for each number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeSteps {
    /// Step of the positions, as a fraction of the size of the typical Gaussian: the median over the Gaussians of the
    /// geometric mean of the three scales. What a shift does to the picture depends on how large the shifted Gaussian
    /// is, and Gaussians are as small as the pixels that they were trained on; so this one number suits scenes of any
    /// extent and resolution. The grid never has more than 2^20 cells along an axis: beyond, the step grows.
    pub position: f32,
    /// Step of the natural logarithms of the scales: 0.1 is a size that is off by 5 % at most.
    pub log_scale: f32,
    /// Step of the quaternions' components, which are not normalised.
    pub quaternion: f32,
    /// Step of the opacities before the sigmoid; 0.25 is 3 % of opacity at most, where it is a half.
    pub opacity_logit: f32,
    /// Step of the spherical harmonics of degree 0; 0.02 is 1.4 of 255 levels of a colour.
    pub sh_dc: f32,
}

impl Default for AttributeSteps {
    fn default() -> Self {
        Self { position: 0.125, log_scale: 0.1, quaternion: 0.03, opacity_logit: 0.25, sh_dc: 0.03 }
    }
}

impl AttributeSteps {
    /// Refuses steps that are not positive or are absurdly large.
    pub(super) fn check(&self) -> Result<(), CodecError> {
        let Self { position, log_scale, quaternion, opacity_logit, sh_dc } = *self;
        check_step("position", position)?;
        check_step("log_scale", log_scale)?;
        check_step("quaternion", quaternion)?;
        check_step("opacity_logit", opacity_logit)?;
        check_step("sh_dc", sh_dc)
    }
}

/// Refuses a step under which a decoded number could be infinite.
pub(super) fn check_step(attribute: &str, step: f32) -> Result<(), CodecError> {
    if (f32::MIN_POSITIVE..=LARGEST_STEP).contains(&step) {
        return Ok(());
    }
    let field = format!("step of {attribute}");
    Err(CodecError::invalid(SECTION, field, step, format!("a positive number, at most {LARGEST_STEP:e}")))
}
