//! How finely the attributes are quantized.

use super::SECTION;
use crate::{CodecError, adaptive::LARGEST_STEP, steps};

/// How finely each attribute of a Gaussian is quantized.
///
/// Every step is the distance between two neighboring levels, so an attribute is off by half of it at most. Measured
/// at 200 pixels, the defaults cost 0.1 dB of a scene that reaches 33 dB, and less of one that reaches 26; positions and
/// scales are what an image feels most. Halving a step costs one bit for each of its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeSteps {
    /// Step of the positions, as a fraction of the size of the typical Gaussian: the median over the Gaussians of the
    /// geometric mean of the three scales. What a shift does to the image depends on how large the shifted Gaussian
    /// is, and Gaussians are as small as the pixels that they were trained on; so this one number suits scenes of any
    /// extent and resolution. The grid never has more than 2^20 cells along an axis: beyond, the step grows.
    pub position: f32,
    /// Step of the natural logarithms of the scales: 0.1 is a size that is off by 5 % at most.
    pub log_scale: f32,
    /// Step of the quaternions' components, which are not normalized.
    pub quaternion: f32,
    /// Step of the opacities before the sigmoid; 0.4 is 5 % of opacity at most, where it is a half.
    pub opacity_logit: f32,
    /// Step of the spherical harmonics of degree 0; 0.04 is 2.9 of 255 levels of a color,
    /// so a color is off by half of that at most.
    pub sh_dc: f32,
}

impl Default for AttributeSteps {
    fn default() -> Self {
        Self { position: 0.05, log_scale: 0.1, quaternion: 0.02, opacity_logit: 0.4, sh_dc: 0.04 }
    }
}

impl AttributeSteps {
    /// Refuses steps below [`LEAST_STEP`](crate::checks::LEAST_STEP) (a position's only where it is not positive) or above 1e30.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), CodecError> {
        self.named().into_iter().try_for_each(|(attribute, step)| steps::attribute_step(attribute, step))
    }

    /// The nearest steps that [`AttributeSteps::check`] takes; NaN becomes the smallest.
    pub fn clamped(&self) -> Self {
        let nearest = |step: f32, least: f32| step.max(least).min(LARGEST_STEP);
        let step = |step: f32| nearest(step, steps::LEAST_STEP);
        Self {
            position: nearest(self.position, f32::MIN_POSITIVE),
            log_scale: step(self.log_scale),
            quaternion: step(self.quaternion),
            opacity_logit: step(self.opacity_logit),
            sh_dc: step(self.sh_dc),
        }
    }

    /// The steps with their names, which are those of the fields.
    pub fn named(&self) -> [(&'static str, f32); 5] {
        let Self { position, log_scale, quaternion, opacity_logit, sh_dc } = *self;
        [
            ("position", position),
            ("log_scale", log_scale),
            ("quaternion", quaternion),
            ("opacity_logit", opacity_logit),
            ("sh_dc", sh_dc),
        ]
    }
}

/// Refuses a step of a stream under which a decoded number could be infinite.
pub(super) fn check_step(attribute: &str, step: f32) -> Result<(), CodecError> {
    steps::check_step(SECTION, format!("step of {attribute}"), step, f32::MIN_POSITIVE)
}
