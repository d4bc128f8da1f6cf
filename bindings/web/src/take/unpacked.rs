//! A decoded segment as bytes, on its way from the worker that decodes to the one that draws. Both are of the same version.

use light4gs_codec::{CodecError, SceneData, decode_with_limits, encode};

use super::unpacked_limits;

/// A decoded segment.
#[derive(Debug, PartialEq)]
pub(super) struct Unpacked {
    pub(super) scene: SceneData,
    pub(super) hidden: Vec<bool>,
}

impl Unpacked {
    /// The number of bits of the hidden list, a byte for each, and the scene as a stream without loss.
    pub(super) fn write(&self) -> Result<Vec<u8>, CodecError> {
        let stream = encode(&self.scene)?;
        // At most as many as there are Gaussians.
        let mut bytes = (self.hidden.len() as u32).to_le_bytes().to_vec();
        bytes.extend(self.hidden.iter().map(|&hidden| u8::from(hidden)));
        bytes.extend(stream);
        Ok(bytes)
    }

    pub(super) fn read(bytes: &[u8]) -> Result<Self, CodecError> {
        let cut = || CodecError::MissingSection { section: "unpacked segment" };
        let (count, rest) = bytes.split_first_chunk().ok_or_else(cut)?;
        let (hidden, stream) = rest.split_at_checked(u32::from_le_bytes(*count) as usize).ok_or_else(cut)?;
        let scene = decode_with_limits(stream, &unpacked_limits())?;
        Ok(Self { scene, hidden: hidden.iter().map(|&hidden| hidden != 0).collect() })
    }
}
