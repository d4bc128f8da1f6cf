//! The context model of the hexplanes: its shape, the hyperprior's tables, its weights.

use super::{SectionKind, weights};
use crate::{
    CodecError, ContextModelArrays, ContextModelShape, ContextParts, ConvolutionLayer, ConvolutionShape, Limits,
    PerGroup, SpatialKernel,
    context_model::{CONTEXT_PREDICTION, masked_taps},
    entropy::{read_tables, write_tables},
    limits::at_most,
    network_weights::{TensorLength, WeightPrecision},
    reader::Reader,
    writer::Writer,
};

const SECTION: &str = SectionKind::ContextModel.name();

/// Writes a model whose arrays are sound, with float32 weights where there is no precision; returns it as a decoder
/// gets it.
pub(crate) fn write(
    model: &ContextModelArrays,
    precision: Option<WeightPrecision>,
    writer: &mut Writer,
) -> Result<ContextModelArrays, CodecError> {
    write_shape(&model.shape, writer);
    if model.shape.parts.hyperprior {
        writer.block(&write_tables(&model.hyper_tables));
        writer.f32s(&model.hyper_medians);
    }
    let stored: Vec<_> = model.layers.iter().map(stored_weight).collect();
    let tensors: Vec<weights::Tensor<'_>> = model
        .layers
        .iter()
        .zip(&stored)
        .flat_map(|(layer, weight)| [(layer.shape.name, &weight[..]), (layer.shape.name, &layer.bias[..])])
        .collect();
    let encoded = weights::encode(SECTION, &tensors, precision)?;
    writer.bytes.extend(encoded.bytes);
    let layers = layers(model.shape.layers(), encoded.tensors);
    Ok(ContextModelArrays { layers, ..model.clone() })
}

/// Reads the shape alone.
pub(crate) fn read_shape(reader: &mut Reader<'_>, limits: &Limits) -> Result<ContextModelShape, CodecError> {
    let bits = reader.u8("parts")?;
    let Some(parts) = ContextParts::from_bits(bits) else {
        return Err(CodecError::invalid(SECTION, "parts", format!("{bits:#010b}"), "no more than the lowest 5 bits"));
    };
    let mut size = |field: &str| reader.varint_at_most(field, limits.layer_width);
    let mut shape = ContextModelShape {
        channels: size("channels")?,
        parameter_channels: [size("parameter channels")?, size("parameter channels")?],
        parts,
        ..ContextModelShape::default()
    };
    if parts.hyperprior {
        shape.hyper_channels = size("hyper channels")?;
        shape.synthesis_channels = [size("synthesis channels")?, size("synthesis channels")?];
    }
    if parts.checkerboard {
        shape.context_groups = size("context groups")?;
    }
    if parts.inter_plane {
        shape.inter_plane = SpatialKernel { kernel: size("inter-plane kernel")?, groups: size("inter-plane groups")? };
    }
    if parts.inter_scale {
        shape.inter_scale = SpatialKernel { kernel: size("inter-scale kernel")?, groups: size("inter-scale groups")? };
    }
    shape.centres =
        PerGroup { space_only: reader.finite("space-only centre")?, space_time: reader.finite("space-time centre")? };
    shape.check(limits)?;
    Ok(shape)
}

fn write_shape(shape: &ContextModelShape, writer: &mut Writer) {
    let mut sizes = vec![shape.channels, shape.parameter_channels[0], shape.parameter_channels[1]];
    if shape.parts.hyperprior {
        sizes.extend([shape.hyper_channels, shape.synthesis_channels[0], shape.synthesis_channels[1]]);
    }
    if shape.parts.checkerboard {
        sizes.push(shape.context_groups);
    }
    if shape.parts.inter_plane {
        sizes.extend([shape.inter_plane.kernel, shape.inter_plane.groups]);
    }
    if shape.parts.inter_scale {
        sizes.extend([shape.inter_scale.kernel, shape.inter_scale.groups]);
    }
    writer.u8(shape.parts.bits());
    for size in sizes {
        writer.varint(size.into());
    }
    writer.f32s(&[shape.centres.space_only, shape.centres.space_time]);
}

/// Reads a model.
pub(crate) fn read(bytes: &[u8], quantised: bool, limits: &Limits) -> Result<ContextModelArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let shape = read_shape(&mut reader, limits)?;
    let (mut hyper_tables, mut hyper_medians) = (Vec::new(), Vec::new());
    if shape.parts.hyperprior {
        at_most(SECTION, "hyper channels", shape.hyper_channels.into(), limits.channels)?;
        let block = reader.block("tables of the hyperprior")?;
        hyper_tables = read_tables(block, shape.hyper_channels as usize)
            .map_err(|_| CodecError::invalid(SECTION, "tables of the hyperprior", "damaged", "frequency tables"))?;
        hyper_medians = reader.f32s("medians of the hyperprior", shape.hyper_channels.into())?;
    }
    let shapes = shape.layers();
    let lengths: Vec<_> = shapes
        .iter()
        .flat_map(|shape| [stored_weights(shape), u64::from(shape.outputs)].map(|length| (shape.name, length)))
        .map(|(name, length)| TensorLength { name, length })
        .collect();
    let tensors = weights::decode(SECTION, reader.rest(), quantised, &lengths, limits)?;
    let model = ContextModelArrays { shape, layers: layers(shapes, tensors), hyper_tables, hyper_medians };
    model.check(limits)?;
    Ok(model)
}

/// Layers from a weight and a bias each, as they are stored.
fn layers(shapes: Vec<ConvolutionShape>, tensors: Vec<Vec<f32>>) -> Vec<ConvolutionLayer> {
    let mut tensors = tensors.into_iter();
    let mut next = || tensors.next().expect("two tensors a layer");
    let layer = |shape| ConvolutionLayer { shape, weight: unmasked(&shape, next()), bias: next() };
    shapes.into_iter().map(layer).collect()
}

/// Numbers of a weight that the stream holds.
fn stored_weights(shape: &ConvolutionShape) -> u64 {
    let weights = shape.weights();
    if shape.name == CONTEXT_PREDICTION { weights / 25 * masked_taps().count() as u64 } else { weights }
}

/// A weight without what the checkerboard mask hides.
fn stored_weight(layer: &ConvolutionLayer) -> Vec<f32> {
    if layer.shape.name != CONTEXT_PREDICTION {
        return layer.weight.clone();
    }
    layer.weight.chunks_exact(25).flat_map(|kernel| masked_taps().map(|tap| kernel[tap])).collect()
}

/// The whole weight, zeros where it is masked.
fn unmasked(shape: &ConvolutionShape, stored: Vec<f32>) -> Vec<f32> {
    if shape.name != CONTEXT_PREDICTION {
        return stored;
    }
    let mut weight = vec![0.0; shape.weights() as usize];
    for (kernel, stored) in weight.chunks_exact_mut(25).zip(stored.chunks_exact(masked_taps().count())) {
        masked_taps().zip(stored).for_each(|(tap, &value)| kernel[tap] = value);
    }
    weight
}
