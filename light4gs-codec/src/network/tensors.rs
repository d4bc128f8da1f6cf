//! The weights of networks as bytes: float32 one after the other, or quantized as in [`crate::network_weights`].

use super::{
    Network,
    weights::{self, EncodedWeights, TensorLength, WeightPrecision, WeightTensor},
};
use crate::{
    CodecError,
    budget::Budget,
    bytes::{Reader, Writer, sections::Encoding},
    limits::at_most,
};

/// A tensor's name in messages.
const NAME: &str = "weights";

/// Numbers that a section holds.
#[derive(Clone, Debug)]
pub(crate) struct StoredTensor {
    pub(crate) values: Vec<f32>,
    /// Length of a row, see [`WeightTensor::row`].
    pub(crate) row: usize,
}

/// Appends tensors, as float32 where there is no precision; returns them as a decoder gets them.
pub(crate) fn write_tensors(
    section: &'static str,
    tensors: Vec<StoredTensor>,
    precision: Option<WeightPrecision>,
    writer: &mut Writer,
) -> Result<Vec<Vec<f32>>, CodecError> {
    let Some(precision) = precision else {
        tensors.iter().for_each(|tensor| writer.f32s(&tensor.values));
        return Ok(tensors.into_iter().map(|tensor| tensor.values).collect());
    };
    let tensors: Vec<_> = tensors
        .iter()
        .map(|StoredTensor { values, row }| WeightTensor { name: NAME, values, row: *row, precision })
        .collect();
    let EncodedWeights { bytes, tensors } = weights::encode(section, &tensors)?;
    writer.bytes.extend(bytes);
    Ok(tensors)
}

/// Tensors of known lengths from bytes. All bytes must be used.
pub(crate) fn read_tensors(
    section: &'static str,
    bytes: &[u8],
    encoding: Encoding,
    lengths: &[TensorLength<'_>],
    budget: &Budget,
) -> Result<Vec<Vec<f32>>, CodecError> {
    let total = lengths.iter().fold(0u64, |sum, tensor| sum.saturating_add(tensor.length));
    at_most(section, "number of weights", total, budget.limits.layer_weights)?;
    if encoding == Encoding::Quantized {
        return weights::decode_within(section, bytes, lengths, budget);
    }
    budget.things(section, total, 8, 4)?;
    let mut reader = Reader::new(section, bytes);
    let tensors = lengths.iter().map(|tensor| reader.f32s(tensor.name, tensor.length)).collect::<Result<_, _>>()?;
    reader.finish()?;
    Ok(tensors)
}

/// Appends the weights of networks, and replaces them by those that a decoder gets.
pub(crate) fn write_weights(
    section: &'static str,
    networks: &mut [&mut Network],
    precision: Option<WeightPrecision>,
    writer: &mut Writer,
) -> Result<(), CodecError> {
    let tensors = networks.iter().flat_map(|network| network.stored_tensors()).collect();
    let mut decoded = write_tensors(section, tensors, precision, writer)?.into_iter();
    networks.iter_mut().for_each(|network| network.set_stored_tensors(&mut decoded));
    Ok(())
}

/// Reads the weights of networks, whose weights are still empty.
pub(crate) fn read_weights(
    section: &'static str,
    networks: &mut [&mut Network],
    bytes: &[u8],
    encoding: Encoding,
    budget: &Budget,
) -> Result<(), CodecError> {
    // Masked numbers take memory, though they are not in the stream.
    let whole = networks.iter().fold(0u64, |sum, network| sum.saturating_add(network.weights()));
    budget.things(section, whole, 4, 4)?;
    let lengths: Vec<_> = networks.iter().flat_map(|network| network.tensor_lengths(NAME)).collect();
    let mut tensors = read_tensors(section, bytes, encoding, &lengths, budget)?.into_iter();
    networks.iter_mut().for_each(|network| network.set_stored_tensors(&mut tensors));
    Ok(())
}
