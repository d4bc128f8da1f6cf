//! Parts of the compressor by themselves, for those who measure, compare or draw.
//!
//! Decoding by parts is [`crate::OpenStream`]'s; the other attributes are in [`crate::attributes`].

use crate::{
    CodecError, GaussianArrays, HexPlaneArrays, Limits, PlaneCoding, SceneFrameArrays, ShCoding,
    harmonics::Conditions,
    planes,
    sections::{SectionKind, coded_hexplanes, coded_sh, gaussians, hexplanes, sh},
    writer::Writer,
};

/// The bytes of coded planes, with the model's weights as they are given.
///
/// # Errors
/// As [`crate::encode_compressed`].
pub fn encode_planes(hexplane: &HexPlaneArrays, coding: &PlaneCoding) -> Result<Vec<u8>, CodecError> {
    check_planes(hexplane, coding)?;
    let mut writer = Writer::default();
    coded_hexplanes::write(hexplane, &coding.model, &coding.steps, &coding.hyper_symbols, &mut writer)?;
    Ok(writer.bytes)
}

/// The bytes of coded spherical harmonics, with float32 weights. `frame` and `hexplane`, decoded, matter to the
/// hexplane-coupled ones alone.
///
/// # Errors
/// As [`crate::encode_compressed`].
pub fn encode_sh(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    frame: &SceneFrameArrays,
    hexplane: &HexPlaneArrays,
) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::default();
    gaussians::check(gaussians, &limits)?;
    sh::check(gaussians)?;
    hexplanes::check(hexplane, &limits)?;
    let mut writer = Writer::default();
    coded_sh::write(gaussians, coding, None, Conditions { gaussians, frame, hexplane }, &mut writer)?;
    Ok(writer.bytes)
}

/// Gaussians that the values of a plane are coded under, `[M, height, width]` each, in units of the quantisation step.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneDistributions {
    /// Standard deviations as the networks give them; they are bounded below by 0.11 when they are used.
    pub scales: Vec<f32>,
    /// Means.
    pub means: Vec<f32>,
}

/// What the exact executor gives for one plane of a decoded hexplane: the distributions that a stream's intervals come
/// from. The step is not asked for, since all networks see planes in their own units.
///
/// # Errors
/// As [`crate::encode_compressed`]; a plane that is not there.
pub fn plane_distributions(
    hexplane: &HexPlaneArrays,
    coding: &PlaneCoding,
    plane: usize,
) -> Result<PlaneDistributions, CodecError> {
    check_planes(hexplane, coding)?;
    if plane >= hexplane.planes.len() {
        let expected = format!("less than {}", hexplane.planes.len());
        return Err(CodecError::invalid(SectionKind::HexPlanes.name(), "plane", plane, expected));
    }
    let symbols = &coding.hyper_symbols[plane];
    let (scales, means) = planes::parameters(hexplane, &coding.model, symbols, plane);
    Ok(PlaneDistributions { scales, means })
}

fn check_planes(hexplane: &HexPlaneArrays, coding: &PlaneCoding) -> Result<(), CodecError> {
    let limits = Limits::default();
    hexplanes::check(hexplane, &limits)?;
    coding.model.check(&limits)?;
    coded_hexplanes::check(hexplane, &coding.model.shape, &coding.steps, &coding.hyper_symbols)
}
