//! Parts of the compressor, for programs that measure, compare or draw.
//!
//! To decode by parts, see [`crate::OpenStream`]; the other attributes are in [`crate::attributes`].

use crate::{
    CodecError, Distributions, FeaturePlaneArrays, GaussianArrays, Limits, PlaneCoding, SceneCoordinateArrays,
    ShCoding, attributes,
    bytes::{Section, Writer},
    planes,
    sh::{self, coding::Conditions},
};

/// The bytes of coded planes. The model's weights are used as given.
///
/// # Errors
/// As [`crate::encode_compressed`].
pub fn encode_planes(feature_planes: &FeaturePlaneArrays, coding: &PlaneCoding) -> Result<Vec<u8>, CodecError> {
    check_planes(feature_planes, coding)?;
    let mut writer = Writer::default();
    let PlaneCoding { model, steps, latent_symbols } = coding;
    planes::section::write(feature_planes, model, steps, latent_symbols, &Limits::large(), &mut writer)?;
    Ok(writer.bytes)
}

/// The bytes of coded spherical harmonics, with float32 weights. `coordinates` and `feature_planes`, decoded, are used
/// by priors that read them.
///
/// # Errors
/// As [`crate::encode_compressed`].
pub fn encode_sh(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    coordinates: &SceneCoordinateArrays,
    feature_planes: &FeaturePlaneArrays,
) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::large();
    attributes::check(gaussians, &limits)?;
    sh::section::check(gaussians)?;
    planes::head::check(feature_planes, &limits)?;
    let mut writer = Writer::default();
    let conditions = Conditions { gaussians, coordinates, feature_planes };
    sh::section::write(gaussians, coding, None, conditions, &limits, &mut writer)?;
    Ok(writer.bytes)
}

/// The distributions of a decoded plane as the exact executor computes them, `[M, height, width]`. A stream's coding
/// intervals come from these. No step is needed, since all networks read planes in their own units.
///
/// # Errors
/// As [`crate::encode_compressed`]; a plane that does not exist.
pub fn plane_distributions(
    feature_planes: &FeaturePlaneArrays,
    coding: &PlaneCoding,
    plane: usize,
) -> Result<Distributions, CodecError> {
    check_planes(feature_planes, coding)?;
    if plane >= feature_planes.planes.len() {
        let expected = format!("less than {}", feature_planes.planes.len());
        return Err(CodecError::invalid(Section::FeaturePlanes.name(), "plane", plane, expected));
    }
    let symbols = &coding.latent_symbols[plane];
    let (scales, means) = planes::parameters(feature_planes, &coding.model, symbols, plane, &Limits::large())?;
    Ok(Distributions { scales, means })
}

/// The distributions of the spherical harmonics of decoded Gaussians as the exact executor computes them, `[N,
/// channels]`.
///
/// # Errors
/// As [`crate::encode_compressed`]; a coding without networks.
pub fn sh_distributions(
    gaussians: &GaussianArrays,
    coding: &ShCoding,
    coordinates: &SceneCoordinateArrays,
    feature_planes: &FeaturePlaneArrays,
) -> Result<Distributions, CodecError> {
    let limits = Limits::large();
    attributes::check(gaussians, &limits)?;
    sh::section::check(gaussians)?;
    planes::head::check(feature_planes, &limits)?;
    sh::section::distributions(gaussians, coding, Conditions { gaussians, coordinates, feature_planes }, &limits)
}

fn check_planes(feature_planes: &FeaturePlaneArrays, coding: &PlaneCoding) -> Result<(), CodecError> {
    let limits = Limits::large();
    planes::head::check(feature_planes, &limits)?;
    planes::section::check(feature_planes, coding, &limits)
}
