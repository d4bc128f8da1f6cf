//! The weights of a network: float32 one after the other, or quantised as in [`crate::network_weights`].

use crate::{
    CodecError, Limits,
    limits::at_most,
    network_weights::{self, EncodedWeights, TensorLength, WeightPrecision, WeightTensor},
    reader::Reader,
    writer::Writer,
};

/// A tensor's name in messages and its numbers.
pub(crate) type Tensor<'a> = (&'a str, &'a [f32]);

/// Tensors to bytes, float32 where there is no precision; and the tensors as a decoder gets them.
pub(crate) fn encode(
    section: &'static str,
    tensors: &[Tensor<'_>],
    precision: Option<WeightPrecision>,
) -> Result<EncodedWeights, CodecError> {
    let Some(precision) = precision else {
        let mut writer = Writer::default();
        tensors.iter().for_each(|(_, values)| writer.f32s(values));
        let tensors = tensors.iter().map(|(_, values)| values.to_vec()).collect();
        return Ok(EncodedWeights { bytes: writer.bytes, tensors });
    };
    let tensors: Vec<_> = tensors.iter().map(|&(name, values)| WeightTensor { name, values, precision }).collect();
    network_weights::encode(section, &tensors)
}

/// Tensors of known lengths from bytes, all of which must be used.
pub(crate) fn decode(
    section: &'static str,
    bytes: &[u8],
    quantised: bool,
    lengths: &[TensorLength<'_>],
    limits: &Limits,
) -> Result<Vec<Vec<f32>>, CodecError> {
    if quantised {
        let total = lengths.iter().fold(0u64, |sum, tensor| sum.saturating_add(tensor.length));
        at_most(section, "number of weights", total, limits.layer_weights)?;
        return network_weights::decode(section, bytes, lengths, limits);
    }
    let mut reader = Reader::new(section, bytes);
    let tensors = lengths.iter().map(|tensor| reader.f32s(tensor.name, tensor.length)).collect::<Result<_, _>>()?;
    reader.finish()?;
    Ok(tensors)
}
