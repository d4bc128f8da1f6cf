//! Quantization steps: which ones an encoder accepts, and which ones a decoder accepts.

use crate::{CodecError, adaptive::LARGEST_STEP, bytes::Section, plane_layout::PlaneAxes};

/// The smallest step that the encoder accepts. With this step the numbers of a trained scene, which are within some
/// tens of 0, still fit into the 2^22 steps of a symbol.
pub const LEAST_STEP: f32 = 1e-5;

/// The smallest step that a decoder accepts: with it no value is a subnormal number, which processors compute slowly.
pub(crate) const LEAST_STEP_IN_STREAM: f32 = 1.0 / (1u64 << 60) as f32;

/// A number for the space-only planes and one for the space-time planes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerGroup {
    /// For planes without time.
    pub space_only: f32,
    /// For planes with time.
    pub space_time: f32,
}

impl PerGroup {
    /// The number for planes over these axes.
    pub fn of(self, axes: PlaneAxes) -> f32 {
        if axes.is_space_time() { self.space_time } else { self.space_only }
    }
}

/// Refuses a quantization step of planes.
///
/// # Errors
/// A step below [`LEAST_STEP`], above 1e30, or NaN.
pub fn plane_step(step: f32) -> Result<(), CodecError> {
    check_step(Section::FeaturePlanes.name(), "step", step, LEAST_STEP)
}

/// The nearest steps that [`plane_step`] accepts. Learned steps have no other bounds.
pub fn nearest_plane_steps(steps: PerGroup) -> PerGroup {
    PerGroup { space_only: nearest(steps.space_only), space_time: nearest(steps.space_time) }
}

/// Refuses a quantization step of the spherical harmonics beyond degree 0.
///
/// # Errors
/// As [`plane_step`].
pub fn sh_step(step: f32) -> Result<(), CodecError> {
    check_step(Section::Sh.name(), "step", step, LEAST_STEP)
}

/// The nearest step that [`sh_step`] accepts.
pub fn nearest_sh_step(step: f32) -> f32 {
    nearest(step)
}

// NaN becomes the smallest step; `clamp` would keep NaN.
fn nearest(step: f32) -> f32 {
    if step > LEAST_STEP { step.min(LARGEST_STEP) } else { LEAST_STEP }
}

/// Refuses a step of one of the [`AttributeSteps`](crate::attributes::AttributeSteps), by the attribute's name.
///
/// # Errors
/// As [`plane_step`]; the step of `means`, which is relative, may be any normal number up to 1e30.
pub fn attribute_step(attribute: &str, step: f32) -> Result<(), CodecError> {
    check_step(Section::Gaussians.name(), format!("step of {attribute}"), step, least_step(attribute))
}

/// The smallest step that the encoder accepts for an attribute. That of the positions is relative to the size of
/// Gaussians.
pub(crate) fn least_step(attribute: &str) -> f32 {
    if attribute == "means" { f32::MIN_POSITIVE } else { LEAST_STEP }
}

/// Refuses a step outside of a range.
pub(crate) fn check_step(
    section: &'static str,
    field: impl Into<String>,
    step: f32,
    least: f32,
) -> Result<(), CodecError> {
    if (least..=LARGEST_STEP).contains(&step) {
        return Ok(());
    }
    let expected =
        format!("{least:e} to {LARGEST_STEP:e}; make the step {}", if step > 1.0 { "smaller" } else { "larger" });
    Err(CodecError::invalid(section, field, step, expected))
}
