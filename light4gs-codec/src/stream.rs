//! A scene to bytes and back.

use crate::{
    CodecError, Encoding, GaussianArrays, Limits, SceneData,
    container::{Builder, Container},
    fields,
    sections::{SectionKind, deformation, gaussians, hexplanes, meta, scene_frame, sh},
};

/// Turns a scene into a `.l4gs` stream.
///
/// The stream is decoded again and compared with `scene`, bit by bit, before it is returned.
///
/// # Errors
/// An array whose length disagrees with the others, a NaN or an infinity, a number beyond the default [`Limits`]; the
/// message names the section and the field.
pub fn encode(scene: &SceneData) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::default();
    check(scene, &limits)?;
    let mut builder = Builder::new(&scene.meta, &limits)?;
    for kind in SectionKind::ALL {
        builder.section(kind, Encoding::Float32, |writer| match kind {
            SectionKind::Gaussians => gaussians::write(&scene.gaussians, writer),
            SectionKind::Sh => sh::write(&scene.gaussians, writer),
            SectionKind::SceneFrame => scene_frame::write(&scene.frame, writer),
            SectionKind::Deformation => deformation::write(&scene.deformation, writer),
            SectionKind::HexPlanes => hexplanes::write(&scene.hexplane, writer),
        });
    }
    let bytes = builder.finish();
    let decoded = decode_with_limits(&bytes, &limits)?;
    fields::check_same_bits(scene, &decoded)?;
    Ok(bytes)
}

/// Turns a `.l4gs` stream into the scene that it holds.
///
/// # Errors
/// Whatever is wrong with the bytes; the message names the section. No input makes it panic, and none makes it take more
/// memory than a small multiple of the input's length.
pub fn decode(bytes: &[u8]) -> Result<SceneData, CodecError> {
    decode_with_limits(bytes, &Limits::default())
}

/// As [`decode`], within limits of the caller's.
///
/// # Errors
/// As [`decode`].
pub fn decode_with_limits(bytes: &[u8], limits: &Limits) -> Result<SceneData, CodecError> {
    let container = Container::read(bytes, limits)?;
    // Float32 is the only encoding that the table can name, so nothing depends on it yet.
    let payload = |kind| container.section(kind).map(|(Encoding::Float32, payload)| payload);

    let (sh_head, sh_rest) = sh::read(payload(SectionKind::Sh)?, limits)?;
    let without_sh = gaussians::read(payload(SectionKind::Gaussians)?, limits)?;
    if sh_head.count as usize != without_sh.len() {
        let expected = format!("{}, the number of Gaussians", without_sh.len());
        return Err(CodecError::invalid(SectionKind::Sh.name(), "count", sh_head.count, expected));
    }
    let scene = SceneData {
        gaussians: GaussianArrays { sh_degree: sh_head.degree, sh_rest, ..without_sh },
        frame: scene_frame::read(payload(SectionKind::SceneFrame)?)?,
        deformation: deformation::read(payload(SectionKind::Deformation)?, limits)?,
        hexplane: hexplanes::read(payload(SectionKind::HexPlanes)?, limits)?,
        meta: container.meta.clone(),
    };
    check(&scene, limits)?;
    Ok(scene)
}

/// Refuses a scene that contradicts itself, for the encoder and the decoder alike.
fn check(scene: &SceneData, limits: &Limits) -> Result<(), CodecError> {
    meta::check(&scene.meta, limits)?;
    gaussians::check(&scene.gaussians, limits)?;
    sh::check(&scene.gaussians)?;
    deformation::check(&scene.deformation, limits)?;
    hexplanes::check(&scene.hexplane, limits)?;
    fields::check_finite(scene)
}
