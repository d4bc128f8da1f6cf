//! The most that a reader accepts.

use crate::CodecError;

/// The most that a reader accepts, checked before memory is taken.
///
/// The default is for files of strangers: a file takes some seconds of one thread and 256 MiB at most, or a small
/// multiple of its own length if that is more. A program that knows its files may want less, or more:
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
    /// Networks of a section, and priors that use them.
    pub networks: u32,
    /// Nodes, inputs or outputs of one network.
    pub nodes: u32,
    /// Inputs or outputs of one layer, weights of one of its outputs, and channels of all values of a network together.
    pub layer_width: u32,
    /// Weights of all networks of a section.
    pub layer_weights: u64,
    /// Values of all entropy-coded planes, or of the entropy-coded spherical harmonics. Coded values can take next to
    /// no bytes, so this bounds the memory that a small stream can ask for. A stream of `b` bytes may hold `64 b` of
    /// them whatever this says.
    pub coded_values: u64,
    /// Multiplications that the networks of the planes, or those of the spherical harmonics, may ask for. The default is
    /// three times what the largest architecture takes for planes of the paper's size.
    pub multiplications: u64,
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
            networks: 32,
            nodes: 256,
            layer_width: 1 << 16,
            layer_weights: 1 << 21,
            coded_values: 1 << 23,
            multiplications: 1 << 34,
        }
    }
}

impl Limits {
    /// What the encoder keeps to, for files that are trusted: they may take minutes and gigabytes.
    pub const fn large() -> Self {
        Self {
            file_bytes: 1 << 40,
            meta_bytes: 1 << 20,
            sections: 64,
            string_bytes: 1 << 16,
            extras: 1 << 10,
            gaussians: 1 << 28,
            channels: 1 << 12,
            resolution: 1 << 16,
            scales: 16,
            networks: 32,
            nodes: 256,
            layer_width: 1 << 19,
            layer_weights: 1 << 28,
            coded_values: 1 << 30,
            multiplications: 1 << 44,
        }
    }

    /// These limits for a stream of some length, which raises what it may hold.
    pub(crate) fn for_stream(&self, bytes: usize) -> Self {
        Self { coded_values: self.coded_values.max(64 * bytes as u64), ..*self }
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
