//! From a scene to bytes and back.
//!
//! | file | what |
//! |---|---|
//! | `container.rs` | header and table |
//! | `promise.rs` | the most bytes that a section can have, by its head |
//! | `meta.rs`, `scene_coordinates.rs` | the simple sections; the others have modules of their own |
//! | `input.rs`, `compressor.rs`, `parts.rs` | how a scene is to be compressed, and the compressor |
//! | `encoded.rs` | what an encoder makes: the stream, and all that is known of it |
//! | `layers.rs` | layers of Gaussians |
//! | `open.rs`, `incremental.rs` | decoding section by section; decoding while the bytes come |
//! | `info.rs` | a summary without decoding |

mod compressor;
pub(crate) mod container;
mod encoded;
mod incremental;
mod info;
mod input;
mod layers;
pub(crate) mod meta;
mod open;
mod parts;
mod promise;
mod scene_coordinates;

pub use compressor::{Compressor, encode_compressed, encode_compressed_with_limits};
pub use encoded::Encoded;
pub use incremental::StreamDecoder;
#[cfg(not(target_os = "unknown"))]
pub(crate) use info::describe;
pub use info::{LayerInfo, SectionInfo, StreamInfo, info, info_with_limits};
pub use input::{CompressionInput, Profile, WeightPrecisions};
pub use layers::GaussianLayers;
pub use open::{Decoded, OpenStream};
pub use parts::{encode_planes, encode_sh, plane_distributions, sh_distributions};

use container::NewSection;
use layers::LayerHeads;

use crate::{
    CodecError, GaussianArrays, Limits, SceneData, ShBytes, attributes,
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
    Ok(encode_exactly(scene)?.bytes)
}

/// As [`encode`], with all that is known of the stream.
///
/// # Errors
/// As [`encode`].
pub fn encode_exactly(scene: &SceneData) -> Result<Encoded, CodecError> {
    let limits = Limits::large();
    check(scene, &limits)?;
    let SceneData { gaussians, coordinates, feature_planes, motion, .. } = scene;
    let mut sections = Vec::new();
    let mut section = |kind: Kind, writer: Writer| {
        sections.push(NewSection { kind, encoding: Encoding::Float32, payload: writer.bytes });
    };
    let mut writer = Writer::default();
    let attributes = attributes::write_float32(gaussians, &mut writer);
    section(Kind::GaussiansExplicit, writer);
    let mut writer = Writer::default();
    sh::section::write_explicit(gaussians, &mut writer);
    section(Kind::ShExplicit, writer);
    let mut writer = Writer::default();
    scene_coordinates::write(coordinates, &mut writer);
    section(scene_coordinates::kind(coordinates), writer);
    let mut writer = Writer::default();
    motion::section::write(motion, None, &mut writer)?;
    section(Kind::MotionDescription, writer);
    let mut writer = Writer::default();
    planes::explicit::write(feature_planes, &mut writer);
    section(Kind::FeaturePlanesExplicit, writer);

    let mut heads = LayerHeads::default();
    let head = attributes::Head { count: gaussians.len() as u32, attributes };
    heads.add(head, sh::section::Head::of(gaussians), limits.gaussians)?;
    let planes = planes::Summary::of_explicit(feature_planes)?;
    let sections: Vec<_> = sections.iter().collect();
    let encoded = Encoded::new(&sections, scene.clone(), (heads, planes), ShBytes::default(), &limits)?;
    encoded.verify(&limits)?;
    Ok(encoded)
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
    Ok(OpenStream::with_limits(bytes, limits)?.decode()?.scene)
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
