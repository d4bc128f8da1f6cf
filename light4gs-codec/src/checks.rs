//! What the encoder refuses, for those who want to know before they train.
//!
//! [`crate::encode`] and [`crate::encode_compressed`] ask the same functions. A configuration asks [`hexplane`],
//! [`plane_step`], [`sh_step`] and [`AttributeSteps::check`](crate::attributes::AttributeSteps::check) before there is a scene; a
//! trainer asks [`scene`] and [`coding`] about the scene that it starts from, and [`positions`] about its points. What is
//! left for the end are numbers that training makes: NaN, infinities, and values beyond 2^22 steps.
//!
//! ```
//! use light4gs_codec::checks;
//!
//! assert!(checks::hexplane(32, [64, 64, 64, 24], &[1, 2]).is_ok());
//! let problem = checks::hexplane(32, [64, 64, 64, 24], &[1; 17]).unwrap_err().to_string();
//! assert!(problem.contains("number of scales is 17, at most 16"), "{problem}");
//! assert!(checks::plane_step(1e-45).is_err());
//! ```

use crate::{
    CodecError, CompressionInput, GaussianArrays, Limits, PerGroup, Profile, SceneData, adaptive::LARGEST_STEP,
    attributes, network_weights::WeightPrecision, planes, sh, stream, stream::sections::Section,
};

/// The smallest step that the encoder takes. Under it the numbers of a trained scene, some tens on either side of 0, still
/// fit into the 2^22 steps that a symbol can count.
pub const LEAST_STEP: f32 = 1e-5;

/// The smallest step that a decoder takes: a value is never a subnormal number, which takes long.
pub(crate) const LEAST_STEP_IN_STREAM: f32 = 1.0 / (1u64 << 60) as f32;

/// Refuses a hexplane that no stream can hold, or whose planes cannot be coded: channels, resolution, and multipliers of it.
///
/// # Errors
/// Names the number that is too large, or the axis.
pub fn hexplane(channels: u32, resolution: [u32; 4], multipliers: &[u32]) -> Result<(), CodecError> {
    planes::head::Head::from_shape(channels, resolution, multipliers).check(&Limits::large())?;
    crate::plane_layout::check_resolution(resolution.map(|side| side as usize)).map_err(|illegal| {
        CodecError::invalid(Section::HexPlanes.name(), "resolution", illegal, "what a latent can have")
    })
}

/// Refuses a quantization step of planes.
///
/// # Errors
/// A step below [`LEAST_STEP`], above 1e30, or NaN.
pub fn plane_step(step: f32) -> Result<(), CodecError> {
    check_step(Section::HexPlanes.name(), "step", step, LEAST_STEP)
}

/// The nearest steps that [`plane_step`] takes: learned steps are not bounded by anything else.
pub fn nearest_plane_steps(steps: PerGroup) -> PerGroup {
    // NaN becomes the smallest, which `clamp` would keep.
    let nearest = |step: f32| if step > LEAST_STEP { step.min(LARGEST_STEP) } else { LEAST_STEP };
    PerGroup { space_only: nearest(steps.space_only), space_time: nearest(steps.space_time) }
}

/// Refuses a quantization step of the spherical harmonics beyond degree 0.
///
/// # Errors
/// As [`plane_step`].
pub fn sh_step(step: f32) -> Result<(), CodecError> {
    check_step(Section::Sh.name(), "step", step, LEAST_STEP)
}

/// Refuses a step of one of the [`AttributeSteps`](crate::attributes::AttributeSteps), by the name of its field.
///
/// # Errors
/// As [`plane_step`]; a position's step, which is relative, may be any normal number up to 1e30.
pub fn attribute_step(attribute: &str, step: f32) -> Result<(), CodecError> {
    let least = if attribute == "position" { f32::MIN_POSITIVE } else { LEAST_STEP };
    check_step(Section::Gaussians.name(), format!("step of {attribute}"), step, least)
}

/// Refuses a precision of network weights.
///
/// # Errors
/// Bits beyond 2 to 16; a step that is not positive or above 1e30.
pub fn weight_precision(precision: WeightPrecision) -> Result<(), CodecError> {
    match precision {
        WeightPrecision::Bits(2..=16) => Ok(()),
        WeightPrecision::Bits(bits) => Err(CodecError::invalid("weights", "precision", bits, "2 to 16 bits")),
        WeightPrecision::Step(step) => check_step("weights", "step", step, f32::MIN_POSITIVE),
    }
}

/// Refuses points where no Gaussian can be: beyond ±1e30 along an axis, and NaN.
///
/// # Errors
/// Names the first one.
pub fn positions(positions: &[[f32; 3]]) -> Result<(), CodecError> {
    attributes::check_positions(positions)
}

/// Refuses a scene that [`crate::encode`] refuses.
///
/// # Errors
/// An array whose length disagrees with the others, a NaN or an infinity, a number beyond [`Limits::large`], a name that no
/// stream can have; the message names the section and the field.
pub fn scene(scene: &SceneData) -> Result<(), CodecError> {
    stream::check(scene, &Limits::large())
}

/// Refuses what [`crate::encode_compressed`] refuses before it codes the first number: a scene as [`scene()`] does, steps,
/// precisions, and entropy models that contradict themselves or the scene, or that ask for more than [`Limits::large`].
///
/// # Errors
/// The message names the section and the field.
pub fn coding(scene: &SceneData, input: &CompressionInput) -> Result<(), CodecError> {
    coding_within(scene, input, &Limits::large())
}

/// As [`coding`], within other limits.
pub(crate) fn coding_within(scene: &SceneData, input: &CompressionInput, limits: &Limits) -> Result<(), CodecError> {
    stream::check(scene, limits)?;
    let CompressionInput { profile, planes, sh, attributes, weights } = input;
    if *profile == Profile::Compact {
        positions(&scene.gaussians.means)?;
        attributes.check()?;
        for precision in [weights.motion, weights.context_model, weights.sh] {
            weight_precision(precision)?;
        }
    }
    if let Some(coding) = planes {
        planes::section::check(&scene.hexplane, coding, limits)?;
    }
    check_sh(&scene.gaussians, sh, scene.hexplane.features(), limits)
}

fn check_sh(
    gaussians: &GaussianArrays,
    coding: &sh::ShCoding,
    features: u64,
    limits: &Limits,
) -> Result<(), CodecError> {
    sh_step(coding.step())?;
    coding.check(gaussians.sh_degree, features, limits)
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
