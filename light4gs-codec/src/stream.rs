//! A scene to bytes and back.

use crate::{
    CodecError, Encoding, Limits, OpenStream, SceneData,
    container::{Builder, PLAIN_VERSION},
    fields,
    sections::{SectionKind, deformation, gaussians, hexplanes, meta, scene_frame, sh},
};

/// Turns a scene into a `.l4gs` stream without loss: version 1 of the format, all numbers float32.
///
/// The stream is decoded again and compared with `scene`, bit by bit, before it is returned.
///
/// # Errors
/// An array whose length disagrees with the others, a NaN or an infinity, a number beyond the default [`Limits`]; the
/// message names the section and the field.
pub fn encode(scene: &SceneData) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::default();
    check(scene, &limits)?;
    let mut builder = Builder::new(PLAIN_VERSION, SectionKind::CORE.len(), &scene.meta, &limits)?;
    for kind in SectionKind::CORE {
        builder.section(kind, Encoding::Float32, |writer| match kind {
            SectionKind::Gaussians => gaussians::write(&scene.gaussians, writer),
            SectionKind::Sh => sh::write(&scene.gaussians, writer),
            SectionKind::SceneFrame => scene_frame::write(&scene.frame, writer),
            SectionKind::Deformation => deformation::write(&scene.deformation, writer),
            SectionKind::HexPlanes => hexplanes::write(&scene.hexplane, writer),
            SectionKind::ContextModel => {}
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
/// Whatever is wrong with the bytes; the message names the section. No input makes it panic, and none makes it take
/// more memory than a small multiple of the input's length or of [`Limits::coded_values`], whichever is more.
pub fn decode(bytes: &[u8]) -> Result<SceneData, CodecError> {
    decode_with_limits(bytes, &Limits::default())
}

/// As [`decode`], within limits of the caller's.
///
/// # Errors
/// As [`decode`].
pub fn decode_with_limits(bytes: &[u8], limits: &Limits) -> Result<SceneData, CodecError> {
    OpenStream::with_limits(bytes, limits)?.scene()
}

/// Refuses a scene that contradicts itself, for the encoder and the decoder alike.
pub(crate) fn check(scene: &SceneData, limits: &Limits) -> Result<(), CodecError> {
    meta::check(&scene.meta, limits)?;
    gaussians::check(&scene.gaussians, limits)?;
    sh::check(&scene.gaussians)?;
    deformation::check(&scene.deformation, limits)?;
    hexplanes::check(&scene.hexplane, limits)?;
    fields::check_finite(scene)
}
