//! The most that a reader accepts.

use crate::{CodecError, plane_layout::PlaneAxes};

/// The most that a reader accepts, checked before memory and time are taken.
///
/// The default is for files of strangers: a file is at most 1 GiB long, and takes at most [`Limits::memory_bytes`], and
/// [`Limits::nanoseconds`] on one thread, or a small multiple of its own length if that is more. A program that knows its files may set lower or
/// higher limits:
///
/// ```
/// use light4gs_codec::{Limits, SceneData, decode_with_limits, encode};
///
/// let bytes = encode(&SceneData::default())?;
/// let limits = Limits { gaussians: 1_000_000, ..Limits::default() };
/// assert!(decode_with_limits(&bytes, &limits).is_ok());
/// assert!(decode_with_limits(&bytes, &Limits::large()).is_ok());
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a whole stream; a take may be longer, each stream in it may not. A section has at most the bytes that the counts in its head can take.
    pub file_bytes: u64,
    /// Bytes of the scene meta in the header.
    pub meta_bytes: u32,
    /// Entries of the section table.
    pub sections: u32,
    /// Bytes of one string.
    pub string_bytes: u32,
    /// Bytes of a name: the scene's, a key's, a tensor's.
    pub name_bytes: u32,
    /// Extra entries in the scene meta.
    pub extras: u32,
    /// Frames of the source.
    pub frames: u32,
    /// Width and height of the source's camera, in pixels.
    pub image_side: u32,
    /// Width times height of the source's camera.
    pub image_pixels: u64,
    /// Segments of a take, together with the slots for further ones.
    pub segments: u32,
    /// Gaussians.
    pub gaussians: u32,
    /// Attributes of a Gaussian.
    pub attributes: u32,
    /// Numbers that an attribute has for a Gaussian.
    pub attribute_width: u32,
    /// Channels of a plane.
    pub channels: u32,
    /// Samples of a plane along one axis.
    pub resolution: u32,
    /// Scales of the planes.
    pub scales: u32,
    /// Networks of a section, and priors that use them.
    pub networks: u32,
    /// Nodes, inputs or outputs of one network.
    pub nodes: u32,
    /// Inputs or outputs of one layer, weights of one of its outputs, and channels of all values of a network together.
    pub layer_width: u32,
    /// Weights of all networks of a section.
    pub layer_weights: u64,
    /// Memory that decoding takes, results included, but without the stream itself. Added up from counts and sizes
    /// before memory is taken. A stream of `b` bytes may always take `4 b`.
    pub memory_bytes: u64,
    /// Time that decoding takes on one thread of a server core of 2023. Added up from counts and sizes before any work
    /// is done, so that it is the same on every machine. A stream of `b` bytes may always take `400 b`.
    pub nanoseconds: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 1 << 30,
            meta_bytes: 1 << 20,
            sections: 64,
            string_bytes: 1 << 16,
            name_bytes: 1 << 10,
            extras: 1 << 10,
            frames: 100_000,
            image_side: 1 << 14,
            image_pixels: 1 << 25,
            segments: 100_000,
            gaussians: 1 << 26,
            attributes: 64,
            attribute_width: 1 << 8,
            channels: 1 << 12,
            resolution: 1 << 16,
            scales: 16,
            networks: 32,
            nodes: 256,
            layer_width: 1 << 17,
            layer_weights: 1 << 21,
            memory_bytes: 256 << 20,
            nanoseconds: 1_800_000_000,
        }
    }
}

impl Limits {
    /// For files that are trusted, such as your own. A file may be 64 GiB long, and take 64 GiB and half an hour. The encoder writes only
    /// files within these limits.
    pub fn large() -> Self {
        Self {
            file_bytes: 64 << 30,
            image_pixels: 1 << 28,
            layer_width: 1 << 19,
            layer_weights: 1 << 28,
            gaussians: 1 << 28,
            memory_bytes: 64 << 30,
            nanoseconds: 1_800_000_000_000,
            ..Self::default()
        }
    }

    /// Planes of all scales.
    pub(crate) fn planes(&self) -> u32 {
        self.scales.saturating_mul(PlaneAxes::ALL.len() as u32)
    }

    /// These limits for a stream of a given length, which raises the limits of memory and time.
    pub(crate) fn for_stream(&self, bytes: usize) -> Self {
        let bytes = bytes as u64;
        Self { memory_bytes: self.memory_bytes.max(4 * bytes), nanoseconds: self.nanoseconds.max(400 * bytes), ..*self }
    }

    /// Refuses the size of an image: that of a file's camera, or that of an image to be rendered.
    ///
    /// # Errors
    /// A side beyond [`Limits::image_side`], or more pixels than [`Limits::image_pixels`].
    pub fn check_image(&self, width: u32, height: u32) -> Result<(), CodecError> {
        at_most("meta", "width", width.into(), self.image_side)?;
        at_most("meta", "height", height.into(), self.image_side)?;
        at_most("meta", "width times height", u64::from(width) * u64::from(height), self.image_pixels)
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
