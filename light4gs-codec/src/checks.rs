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
    attributes, limits::at_most, network_weights::WeightPrecision, planes, sh, stream, stream::sections::Section,
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

/// Refuses the sizes of a motion network that no stream can hold: a trunk of `depth` layers (0 means 1) of `width` channels over
/// `features`, and a head of two layers for each of `outputs`, the channels that it has in the end.
///
/// # Errors
/// More weights, or more channels of all values together, than a network may have.
pub fn motion_network(features: u64, width: u64, depth: u64, outputs: &[u64]) -> Result<(), CodecError> {
    motion_network_within(features, width, depth, outputs, &Limits::large())
}

fn motion_network_within(
    features: u64,
    width: u64,
    depth: u64,
    outputs: &[u64],
    limits: &Limits,
) -> Result<(), CodecError> {
    // Weights and offsets.
    let layer = |inputs: u64, outputs: u64| inputs.saturating_add(1).saturating_mul(outputs);
    let sum = |numbers: &mut dyn Iterator<Item = u64>| numbers.fold(0, u64::saturating_add);
    let depth = depth.max(1);
    let inner = layer(width, width);
    let heads = outputs.iter().map(|&channels| inner.saturating_add(layer(width, channels)));
    let weights = sum(&mut [layer(features, width), inner.saturating_mul(depth - 1)].into_iter().chain(heads));
    // Every layer but the last of a head has a ReLU behind it.
    let hidden = (depth + outputs.len() as u64).saturating_mul(2).saturating_mul(width);
    let channels = sum(&mut [features, hidden].into_iter().chain(outputs.iter().copied()));
    let section = Section::Motion.name();
    at_most(section, "channels of all values", channels, limits.layer_width)?;
    at_most(section, "number of weights", weights, limits.layer_weights)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{Layer, Network};

    /// The numbers are those of the network that a model writes.
    #[test]
    fn sizes_of_a_motion_network_are_counted_as_the_network_counts_them() {
        let (features, width, outputs) = (5u64, 7u64, [3u64, 48]);
        let linear = |inputs: u64, outputs: u64| {
            Layer::linear(vec![0.0; (inputs * outputs) as usize], vec![0.0; outputs as usize])
        };
        for depth in [1, 3] {
            let (mut network, [value]) = Network::new([features as u32]);
            let mut hidden = network.layer(value, linear(features, width));
            for _ in 1..depth {
                let rectified = network.relu(hidden);
                hidden = network.layer(rectified, linear(width, width));
            }
            let rectified = network.relu(hidden);
            for channels in outputs {
                let hidden = network.layer(rectified, linear(width, width));
                let rectified = network.relu(hidden);
                let value = network.layer(rectified, linear(width, channels));
                network.output(value);
            }
            let weights = network.weights();
            let channels = features + 2 * (depth + 2) * width + 51;
            for (layer_weights, layer_width, fits) in
                [(weights, channels, true), (weights - 1, channels, false), (weights, channels - 1, false)]
            {
                let limits = Limits { layer_weights, layer_width: layer_width as u32, ..Limits::large() };
                assert_eq!(motion_network_within(features, width, depth, &outputs, &limits).is_ok(), fits);
                assert_eq!(network.check("motion", "the network", &limits).is_ok(), fits);
            }
        }
        assert!(motion_network(64, 4096, 1, &[3, 3, 4, 1, 48]).is_ok());
        assert!(motion_network(32, 4096, 17, &[3, 3, 4, 1]).is_err());
        assert!(motion_network(u64::MAX, u64::MAX, u64::MAX / 2, &[u64::MAX]).is_err());
    }
}
