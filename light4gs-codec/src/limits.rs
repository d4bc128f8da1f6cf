//! The most that a reader accepts.

use crate::CodecError;

/// The most that a reader accepts, checked before memory is taken.
///
/// The default is far beyond any scene that fits into a machine of today. A program that reads files of
/// strangers may want less:
///
/// ```
/// use light4gs_codec::{Limits, SceneData, decode_with_limits, encode};
///
/// let bytes = encode(&SceneData::default())?;
/// let limits = Limits { gaussians: 1_000_000, ..Limits::default() };
/// assert!(decode_with_limits(&bytes, &limits).is_ok());
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a whole stream.
    pub file_bytes: u64,
    /// Bytes of the scene meta in the header.
    pub meta_bytes: u32,
    /// Entries of the section table.
    pub sections: u32,
    /// Bytes of one string.
    pub string_bytes: u32,
    /// Free notes in the scene meta.
    pub extras: u32,
    /// Gaussians.
    pub gaussians: u32,
    /// Channels of a plane.
    pub channels: u32,
    /// Samples of a plane along one axis.
    pub resolution: u32,
    /// Scales of the hexplane.
    pub scales: u32,
    /// Layers of the network.
    pub layers: u32,
    /// Inputs or outputs of one layer.
    pub layer_width: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 1 << 38,
            meta_bytes: 1 << 20,
            sections: 64,
            string_bytes: 1 << 16,
            extras: 1 << 10,
            gaussians: 1 << 26,
            channels: 1 << 12,
            resolution: 1 << 16,
            scales: 16,
            layers: 1 << 10,
            layer_width: 1 << 16,
        }
    }
}

/// Refuses a number above its limit.
pub(crate) fn at_most(
    section: &'static str,
    field: impl Into<String>,
    found: u64,
    limit: impl Into<u64>,
) -> Result<(), CodecError> {
    let limit = limit.into();
    if found <= limit { Ok(()) } else { Err(CodecError::OverLimit { section, field: field.into(), found, limit }) }
}
