//! The weights of a network: float32, or quantised.

use crate::{CodecError, Limits, limits::at_most, reader::Reader, writer::Writer};

/// How finely weights are quantised.
pub(crate) type Precision = u8;

/// Tensors to bytes; float32 where there is no precision.
pub(crate) fn encode(tensors: &[Vec<f32>], _precision: Option<Precision>) -> Result<Vec<u8>, CodecError> {
    let mut writer = Writer::default();
    tensors.iter().for_each(|tensor| writer.f32s(tensor));
    Ok(writer.bytes)
}

/// Tensors of known lengths from bytes.
pub(crate) fn decode(
    section: &'static str,
    bytes: &[u8],
    _quantised: bool,
    lengths: &[u64],
    limits: &Limits,
) -> Result<Vec<Vec<f32>>, CodecError> {
    let total = lengths.iter().fold(0u64, |sum, &length| sum.saturating_add(length));
    at_most(section, "number of weights", total, limits.layer_weights)?;
    let mut reader = Reader::new(section, bytes);
    let tensors = lengths.iter().map(|&length| reader.f32s("weights", length)).collect::<Result<_, _>>()?;
    reader.finish()?;
    Ok(tensors)
}
