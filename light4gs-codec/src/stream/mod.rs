//! From a scene to bytes and back.
//!
//! | file | what |
//! |---|---|
//! | `container.rs` | header and table |
//! | `meta.rs`, `scene_coordinates.rs` | the simple sections; the others have modules of their own |
//! | `input.rs`, `compressor.rs`, `parts.rs` | how a scene is to be compressed, and the compressor |
//! | `layers.rs` | layers of Gaussians |
//! | `open.rs`, `incremental.rs` | decoding section by section; decoding while the bytes come |
//! | `info.rs` | a summary without decoding |

mod compressor;
pub(crate) mod container;
mod incremental;
mod info;
mod input;
mod layers;
mod meta;
mod open;
mod parts;
mod scene_coordinates;

pub use compressor::{CompressionReport, Encoded, encode_compressed, encode_compressed_with_limits};
pub use incremental::StreamDecoder;
pub use info::{LayerInfo, SectionInfo, StreamInfo, info, info_with_limits};
pub use input::{CompressionInput, Profile, WeightPrecisions};
pub use layers::GaussianLayers;
pub use open::OpenStream;
pub use parts::{encode_planes, encode_sh, plane_distributions, sh_distributions};

use container::NewSection;

use crate::{
    CodecError, GaussianArrays, Limits, SceneData, attributes,
    bytes::{
        Writer,
        sections::{Encoding, Kind},
    },
    fields, motion, planes, sh,
};

/// Turns a scene into a `.l4gs` stream without loss: all numbers float32.
///
/// Before the stream is returned, it is decoded again and compared with `scene`, bit by bit.
///
/// # Errors
/// An array whose length disagrees with the others, a NaN or an infinity, a number beyond [`Limits::large`]; the
/// message names the section and the field.
pub fn encode(scene: &SceneData) -> Result<Vec<u8>, CodecError> {
    let limits = Limits::large();
    check(scene, &limits)?;
    let section = |kind: Kind, write: &dyn Fn(&mut Writer)| {
        let mut writer = Writer::default();
        write(&mut writer);
        NewSection { kind, encoding: Encoding::Float32, payload: writer.bytes }
    };
    let mut motion_writer = Writer::default();
    motion::section::write(&scene.motion, None, &mut motion_writer)?;
    let sections = [
        section(Kind::GaussiansExplicit, &|writer| attributes::write_float32(&scene.gaussians, writer)),
        section(Kind::ShExplicit, &|writer| sh::section::write_explicit(&scene.gaussians, writer)),
        section(scene_coordinates::kind(&scene.coordinates), &|writer| {
            scene_coordinates::write(&scene.coordinates, writer)
        }),
        section(Kind::MotionDescription, &|writer| writer.bytes.extend_from_slice(&motion_writer.bytes)),
        section(Kind::FeaturePlanesExplicit, &|writer| planes::explicit::write(&scene.feature_planes, writer)),
    ];
    let bytes = container::write(&scene.meta, &sections, &limits)?;
    let decoded = decode_with_limits(&bytes, &limits)?;
    fields::check_same_bits(scene, &decoded)?;
    Ok(bytes)
}

/// Turns a `.l4gs` stream into the scene that it holds.
///
/// # Errors
/// Anything that is wrong with the bytes; the message names the section. No input causes a panic, or takes more memory
/// or time than [`Limits`] allows.
pub fn decode(bytes: &[u8]) -> Result<SceneData, CodecError> {
    decode_with_limits(bytes, &Limits::default())
}

/// As [`decode`], within limits of the caller.
///
/// # Errors
/// As [`decode`].
pub fn decode_with_limits(bytes: &[u8], limits: &Limits) -> Result<SceneData, CodecError> {
    OpenStream::with_limits(bytes, limits)?.scene()
}

/// Refuses a further layer of Gaussians that contradicts itself. [`check`] has accepted the scene with the first one.
pub(crate) fn check_layer(gaussians: &GaussianArrays, limits: &Limits) -> Result<(), CodecError> {
    check_shapes(gaussians, limits)?;
    fields::check_finite_gaussians(gaussians)
}

fn check_shapes(gaussians: &GaussianArrays, limits: &Limits) -> Result<(), CodecError> {
    attributes::check(gaussians, limits)?;
    sh::section::check(gaussians)
}

/// Refuses a scene that contradicts itself, both in the encoder and in the decoder.
pub(crate) fn check(scene: &SceneData, limits: &Limits) -> Result<(), CodecError> {
    meta::check(&scene.meta, limits)?;
    check_shapes(&scene.gaussians, limits)?;
    fields::check_finite(scene)?;
    scene.motion.check(limits)?;
    planes::head::check(&scene.feature_planes, limits)?;
    scene.motion.check_sources(scene.feature_planes.features(), &scene.gaussians)
}
