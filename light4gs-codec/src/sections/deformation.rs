//! The deformation network.

use std::collections::BTreeSet;

use super::{SectionKind, check_length, weights};
use crate::{
    CodecError, HeadFlags, Limits, LinearLayer, NetworkArrays,
    limits::at_most,
    network_weights::{TensorLength, WeightPrecision},
    reader::Reader,
    writer::Writer,
};

const SECTION: &str = SectionKind::Deformation.name();
/// The least bytes that the shape of a layer takes: the length of its name, inputs, outputs.
const LEAST_SHAPE: u64 = 12;

/// What stands before the weights.
#[derive(Clone, Debug)]
pub(crate) struct Head {
    pub(crate) width: u32,
    pub(crate) depth: u32,
    pub(crate) heads: HeadFlags,
    pub(crate) shapes: Vec<Shape>,
}

/// A layer without its weights.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    name: String,
    inputs: u32,
    outputs: u32,
}

impl Head {
    pub(crate) fn read(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let width = reader.u32("width")?;
        let depth = reader.u32("depth")?;
        check_size(width, depth, limits)?;
        let heads = flags_from_bits(reader.u8("heads")?)?;
        let layers = reader.u32("number of layers")?;
        at_most(SECTION, "number of layers", layers.into(), limits.layers)?;
        reader.demand("layers", u64::from(layers) * LEAST_SHAPE)?;
        let mut shapes = Vec::with_capacity(layers as usize);
        for index in 0..layers {
            let shape = Shape {
                name: reader.string(&format!("layers[{index}].name"), limits.string_bytes)?,
                inputs: reader.u32(&format!("layers[{index}].inputs"))?,
                outputs: reader.u32(&format!("layers[{index}].outputs"))?,
            };
            check_shape(&shape.name, shape.inputs, shape.outputs, limits)?;
            shapes.push(shape);
        }
        Ok(Self { width, depth, heads, shapes })
    }
}

/// The head of a network whose weights are quantised: as the plain one, but every integer is a varint.
impl Head {
    pub(crate) fn read_coded(reader: &mut Reader<'_>, limits: &Limits) -> Result<Self, CodecError> {
        let width = reader.varint_at_most("width", limits.layer_width)?;
        let depth = reader.varint_at_most("depth", limits.layers)?;
        let heads = flags_from_bits(reader.u8("heads")?)?;
        let layers = reader.varint_at_most("number of layers", limits.layers)?;
        let mut shapes = Vec::new();
        for index in 0..layers {
            let name = reader.block(&format!("layers[{index}].name"))?;
            at_most(SECTION, "length of a layer's name", name.len() as u64, limits.string_bytes)?;
            let name = std::str::from_utf8(name)
                .map_err(|error| CodecError::invalid(SECTION, format!("layers[{index}].name"), error, "UTF-8"))?;
            let inputs = reader.varint_at_most(&format!("{name}.inputs"), limits.layer_width)?;
            let outputs = reader.varint_at_most(&format!("{name}.outputs"), limits.layer_width)?;
            check_shape(name, inputs, outputs, limits)?;
            shapes.push(Shape { name: name.to_owned(), inputs, outputs });
        }
        Ok(Self { width, depth, heads, shapes })
    }
}

/// Writes a network with quantised weights; returns it as a decoder gets it.
pub(crate) fn write_coded(
    network: &NetworkArrays,
    precision: WeightPrecision,
    writer: &mut Writer,
) -> Result<NetworkArrays, CodecError> {
    writer.varint(network.width.into());
    writer.varint(network.depth.into());
    writer.u8(bits_from_flags(network.heads));
    writer.varint(network.layers.len() as u64);
    for layer in &network.layers {
        writer.block(layer.name.as_bytes());
        writer.varint(layer.inputs.into());
        writer.varint(layer.outputs.into());
    }
    let tensors: Vec<weights::Tensor<'_>> = network
        .layers
        .iter()
        .flat_map(|layer| [&layer.weight, &layer.bias].map(|values| (&layer.name[..], &values[..])))
        .collect();
    let encoded = weights::encode(SECTION, &tensors, Some(precision))?;
    writer.bytes.extend(encoded.bytes);
    let shapes = network.layers.iter().map(|layer| (layer.name.clone(), layer.inputs, layer.outputs));
    Ok(NetworkArrays { layers: assembled(shapes, encoded.tensors), ..network.clone() })
}

/// Reads a network with quantised weights.
pub(crate) fn read_coded(bytes: &[u8], limits: &Limits) -> Result<NetworkArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let Head { width, depth, heads, shapes } = Head::read_coded(&mut reader, limits)?;
    let lengths: Vec<_> = shapes
        .iter()
        .flat_map(|shape| {
            let weights = u64::from(shape.inputs) * u64::from(shape.outputs);
            [weights, shape.outputs.into()].map(|length| TensorLength { name: &shape.name, length })
        })
        .collect();
    let tensors = weights::decode(SECTION, reader.rest(), true, &lengths, limits)?;
    let layers = assembled(shapes.into_iter().map(|shape| (shape.name, shape.inputs, shape.outputs)), tensors);
    Ok(NetworkArrays { width, depth, heads, layers })
}

/// Layers from a weight and a bias each.
fn assembled(shapes: impl Iterator<Item = (String, u32, u32)>, tensors: Vec<Vec<f32>>) -> Vec<LinearLayer> {
    let mut tensors = tensors.into_iter();
    let mut next = || tensors.next().expect("two tensors a layer");
    shapes.map(|(name, inputs, outputs)| LinearLayer { name, inputs, outputs, weight: next(), bias: next() }).collect()
}

fn check_size(width: u32, depth: u32, limits: &Limits) -> Result<(), CodecError> {
    at_most(SECTION, "width", width.into(), limits.layer_width)?;
    at_most(SECTION, "depth", depth.into(), limits.layers)
}

fn check_shape(name: &str, inputs: u32, outputs: u32, limits: &Limits) -> Result<(), CodecError> {
    for (field, size) in [("inputs", inputs), ("outputs", outputs)] {
        if size == 0 {
            return Err(CodecError::invalid(SECTION, format!("{name}.{field}"), 0, "1 or more"));
        }
        at_most(SECTION, format!("{name}.{field}"), size.into(), limits.layer_width)?;
    }
    Ok(())
}

/// Refuses layers whose arrays disagree with their shapes, and names that stand twice.
pub(crate) fn check(network: &NetworkArrays, limits: &Limits) -> Result<(), CodecError> {
    check_size(network.width, network.depth, limits)?;
    at_most(SECTION, "number of layers", network.layers.len() as u64, limits.layers)?;
    let mut names = BTreeSet::new();
    for LinearLayer { name, inputs, outputs, weight, bias } in &network.layers {
        at_most(SECTION, "length of a layer's name", name.len() as u64, limits.string_bytes)?;
        if !names.insert(name) {
            return Err(CodecError::invalid(SECTION, "layers", format!("{name:?} twice"), "each name once"));
        }
        check_shape(name, *inputs, *outputs, limits)?;
        let why = format!("{outputs} outputs, {inputs} inputs");
        check_length(SECTION, format!("{name}.weight"), weight.len(), u64::from(*inputs) * u64::from(*outputs), &why)?;
        check_length(SECTION, format!("{name}.bias"), bias.len(), (*outputs).into(), &why)?;
    }
    Ok(())
}

pub(crate) fn write(network: &NetworkArrays, writer: &mut Writer) {
    writer.u32(network.width);
    writer.u32(network.depth);
    writer.u8(bits_from_flags(network.heads));
    writer.u32(network.layers.len() as u32);
    for layer in &network.layers {
        writer.string(&layer.name);
        writer.u32(layer.inputs);
        writer.u32(layer.outputs);
    }
    for layer in &network.layers {
        writer.f32s(&layer.weight);
        writer.f32s(&layer.bias);
    }
}

pub(crate) fn read(bytes: &[u8], limits: &Limits) -> Result<NetworkArrays, CodecError> {
    let mut reader = Reader::new(SECTION, bytes);
    let Head { width, depth, heads, shapes } = Head::read(&mut reader, limits)?;
    let mut layers = Vec::with_capacity(shapes.len());
    for Shape { name, inputs, outputs } in shapes {
        let weight = reader.f32s(&format!("{name}.weight"), u64::from(inputs) * u64::from(outputs))?;
        let bias = reader.f32s(&format!("{name}.bias"), outputs.into())?;
        layers.push(LinearLayer { name, inputs, outputs, weight, bias });
    }
    reader.finish()?;
    Ok(NetworkArrays { width, depth, heads, layers })
}

fn bits_from_flags(heads: HeadFlags) -> u8 {
    let HeadFlags { position, scale, rotation, opacity, sh } = heads;
    [position, scale, rotation, opacity, sh].iter().enumerate().map(|(bit, &on)| u8::from(on) << bit).sum()
}

fn flags_from_bits(bits: u8) -> Result<HeadFlags, CodecError> {
    if bits >> 5 != 0 {
        return Err(CodecError::invalid(SECTION, "heads", format!("{bits:#010b}"), "no more than the lowest 5 bits"));
    }
    let [position, scale, rotation, opacity, sh] = [0, 1, 2, 3, 4].map(|bit| bits >> bit & 1 == 1);
    Ok(HeadFlags { position, scale, rotation, opacity, sh })
}
