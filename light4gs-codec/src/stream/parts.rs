//! Parts of the compressor by themselves, for those who measure, compare or draw.
//!
//! Decoding by parts is [`crate::OpenStream`]'s; the other attributes are in [`crate::attributes`].

use crate::{
    CodecError, Distributions, GaussianArrays, HexPlaneArrays, Limits, PlaneCoding, SceneFrameArrays, ShCoding,
    attributes,
    bytes::{Section, Writer},
    planes,
    sh::{self, coding::Conditions},
};

/// The bytes of coded planes, with the model's weights as they are given.
///
/// # Errors
/// As [`crate::encode_compressed`].
pub fn encode_planes(hexplane: &HexPlaneArrays, coding: &PlaneCoding) -> Result<Vec<u8>, CodecError> {
    check_planes(hexplane, coding)?;
    let mut writer = Writer::default();
    let PlaneCoding { model, steps, latent_symbols } = coding;
    planes::section::write(hexplane, model, steps, latent_symbols, &Limits::large(), &mut writer)?;
    Ok(writer.bytes)
}

/// The bytes of coded spherical harmonics, with float32 weights. `frame` and `hexplane`, decoded, matter to priors
/// that read them.
///
/// # Errors
/// As [`crate::encode_compressed`].
pub fn encode_sh(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    frame: &SceneFrameArrays,
    hexplane: &HexPlaneArrays,
) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::large();
    attributes::check(gaussians, &limits)?;
    sh::section::check(gaussians)?;
    planes::head::check(hexplane, &limits)?;
    let mut writer = Writer::default();
    let conditions = Conditions { gaussians, frame, hexplane };
    sh::section::write(gaussians, coding, None, conditions, &limits, &mut writer)?;
    Ok(writer.bytes)
}

/// What the exact executor gives for one plane of a decoded hexplane, `[M, height, width]`: the distributions that a
/// stream's intervals come from. The step is not asked for, since all networks see planes in their own units.
///
/// # Errors
/// As [`crate::encode_compressed`]; a plane that is not there.
pub fn plane_distributions(
    hexplane: &HexPlaneArrays,
    coding: &PlaneCoding,
    plane: usize,
) -> Result<Distributions, CodecError> {
    check_planes(hexplane, coding)?;
    if plane >= hexplane.planes.len() {
        let expected = format!("less than {}", hexplane.planes.len());
        return Err(CodecError::invalid(Section::HexPlanes.name(), "plane", plane, expected));
    }
    let symbols = &coding.latent_symbols[plane];
    let (scales, means) = planes::parameters(hexplane, &coding.model, symbols, plane, &Limits::large())?;
    Ok(Distributions { scales, means })
}

/// What the exact executor gives for the spherical harmonics of decoded Gaussians, `[N, channels]`.
///
/// # Errors
/// As [`crate::encode_compressed`]; a coding without networks.
pub fn sh_distributions(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    frame: &SceneFrameArrays,
    hexplane: &HexPlaneArrays,
) -> Result<Distributions, CodecError> {
    let limits = Limits::large();
    attributes::check(gaussians, &limits)?;
    sh::section::check(gaussians)?;
    planes::head::check(hexplane, &limits)?;
    sh::section::distributions(gaussians, coding, Conditions { gaussians, frame, hexplane }, &limits)
}

fn check_planes(hexplane: &HexPlaneArrays, coding: &PlaneCoding) -> Result<(), CodecError> {
    let limits = Limits::large();
    planes::head::check(hexplane, &limits)?;
    planes::section::check(hexplane, coding, &limits)
}
