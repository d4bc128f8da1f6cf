//! What an encoder makes.

use super::{
    Decoded, OpenStream, StreamInfo,
    container::{self, NewSection},
    layers::LayerHeads,
};
use crate::{CodecError, Demand, Limits, SceneData, ShBytes, bytes::sections::Kind, fields, planes, scene::SH_REST};

/// A stream, and all that its encoder knows of it.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The stream.
    pub bytes: Vec<u8>,
    /// The scene as [`decode`](crate::decode) gives it, bit for bit.
    pub decoded: SceneData,
    /// What [`info`](crate::info) says of the stream: all sections, attributes and planes with their bytes.
    pub info: StreamInfo,
    /// Bytes of the spherical harmonics of all layers; 0 where they are float32.
    pub sh: ShBytes,
}

impl Encoded {
    /// The stream of `sections`, which decode to `decoded`.
    pub(super) fn new(
        sections: &[&NewSection],
        decoded: SceneData,
        (heads, planes): (LayerHeads, planes::Summary),
        sh: ShBytes,
        limits: &Limits,
    ) -> Result<Self, CodecError> {
        let (bytes, header) = container::write(&decoded.meta, sections, limits)?;
        let info = StreamInfo::new(&header, heads, planes, decoded.motion.description());
        Ok(Self { bytes, decoded, info, sh })
    }

    /// Decodes the stream and compares it, bit by bit, with what the encoder expects. Returns what a reader must allow.
    ///
    /// # Errors
    /// [`CodecError::SelfCheck`] names what differs; a stream that asks for more than the limits.
    pub fn verify(&self, limits: &Limits) -> Result<Demand, CodecError> {
        let Decoded { scene, info, demand } = OpenStream::with_limits(&self.bytes, limits)?.decode()?;
        fields::check_same_bits(&self.decoded, &scene)?;
        if info != self.info {
            return Err(CodecError::SelfCheck { section: "stream", field: "a size".into() });
        }
        Ok(demand)
    }

    /// Bytes of an attribute of the Gaussians, by its name in [`GaussianArrays::attributes`](crate::GaussianArrays::attributes),
    /// in all layers; 0 where there is none. Heads, tables and networks do not count.
    pub fn attribute_bytes(&self, name: &str) -> u64 {
        if name == SH_REST {
            return self.sh.degrees.iter().sum();
        }
        let named = self.info.attributes.iter().find(|attribute| attribute.name == name);
        named.map_or(0, |attribute| attribute.bytes)
    }

    /// Whether the spherical harmonics are coded as the other attributes are.
    pub fn sh_is_an_attribute(&self) -> bool {
        self.info.sections.iter().any(|section| section.kind == Kind::ShChannels)
    }
}
