//! A network as bytes: its description, and then, elsewhere, the weights of its layers in order.

use super::{Layer, LayerKind, Network, Node, Operation, Value, kernels::masked_taps};
use crate::{
    CodecError, Limits,
    bytes::{Reader, Writer},
    network::weights::TensorLength,
};

const LINEAR: u8 = 0;
const CONVOLUTION: u8 = 1;
const HALVING: u8 = 2;
const DOUBLING: u8 = 3;
const CHECKERBOARD: u8 = 4;
const RELU: u8 = 5;
const LEAKY_RELU: u8 = 6;
const LEAKY_RELU_OF_SLOPE: u8 = 7;
const RESIZE: u8 = 8;
const MEAN_OVER_HEIGHT: u8 = 9;
const MEAN_OVER_WIDTH: u8 = 10;
const TRANSPOSE: u8 = 11;
const SPREAD: u8 = 12;
const CONCATENATE: u8 = 13;
const ADD: u8 = 14;
const MULTIPLY: u8 = 15;
/// Set in a code where the first input is the value before.
const READS_LAST: u8 = 0x80;
/// The slope that [`LEAKY_RELU`] stands for.
const USUAL_SLOPE: f32 = 0.01;

impl Operation {
    fn code(&self) -> u8 {
        match self {
            Self::Layer(Layer { kind, kernel, groups, .. }) => match kind {
                LayerKind::Convolution if (*kernel, *groups) == (1, 1) => LINEAR,
                LayerKind::Convolution => CONVOLUTION,
                LayerKind::Halving => HALVING,
                LayerKind::Doubling => DOUBLING,
                LayerKind::Checkerboard => CHECKERBOARD,
            },
            Self::Relu => RELU,
            Self::LeakyRelu(slope) if *slope == USUAL_SLOPE => LEAKY_RELU,
            Self::LeakyRelu(_) => LEAKY_RELU_OF_SLOPE,
            Self::Resize => RESIZE,
            Self::MeanOverHeight => MEAN_OVER_HEIGHT,
            Self::MeanOverWidth => MEAN_OVER_WIDTH,
            Self::Transpose => TRANSPOSE,
            Self::Spread => SPREAD,
            Self::Concatenate => CONCATENATE,
            Self::Add => ADD,
            Self::Multiply => MULTIPLY,
        }
    }
}

impl Network {
    /// Writes everything but the weights.
    pub(crate) fn write(&self, writer: &mut Writer) {
        writer.varint(self.inputs.len() as u64);
        self.inputs.iter().for_each(|&channels| writer.varint(channels.into()));
        writer.varint(self.nodes.len() as u64);
        for (index, Node { operation, inputs }) in self.nodes.iter().enumerate() {
            let last = (self.inputs.len() + index).checked_sub(1);
            let reads_last = inputs.first().map(|value| value.0 as usize) == last && last.is_some();
            let code = operation.code();
            writer.u8(code | if reads_last { READS_LAST } else { 0 });
            if code == CONCATENATE {
                writer.varint(inputs.len() as u64);
            }
            inputs.iter().skip(usize::from(reads_last)).for_each(|value| writer.varint(value.0.into()));
            match operation {
                Operation::Layer(layer) => {
                    writer.varint(layer.outputs.into());
                    if !matches!(code, LINEAR | DOUBLING) {
                        writer.u8(layer.kernel as u8);
                        writer.varint(layer.groups.into());
                    }
                }
                Operation::LeakyRelu(slope) if code == LEAKY_RELU_OF_SLOPE => writer.f32(*slope),
                _ => {}
            }
        }
        writer.varint(self.outputs.len() as u64);
        self.outputs.iter().for_each(|value| writer.varint(value.0.into()));
    }

    /// Reads what [`Network::write`] writes, and checks it; the weights are empty.
    pub(crate) fn read(
        reader: &mut Reader<'_>,
        section: &'static str,
        name: &str,
        limits: &Limits,
    ) -> Result<Self, CodecError> {
        let count = reader.varint_at_most("number of a network's inputs", limits.nodes)?;
        let inputs = (0..count)
            .map(|_| reader.varint_at_most("channels of an input", limits.layer_width))
            .collect::<Result<Vec<_>, _>>()?;
        let mut channels: Vec<u64> = inputs.iter().map(|&channels| channels.into()).collect();
        let count = reader.varint_at_most("number of a network's nodes", limits.nodes)?;
        let mut nodes = Vec::new();
        for index in 0..count as usize {
            let node = read_node(reader, section, &format!("{name}, node {index}"), &channels, limits)?;
            // The check below says it properly, if it is too many.
            let of = |value: &Value| channels[value.0 as usize];
            channels.push(match &node.operation {
                Operation::Layer(layer) => layer.outputs.into(),
                Operation::Concatenate => node.inputs.iter().fold(0u64, |sum, value| sum.saturating_add(of(value))),
                _ => of(&node.inputs[0]),
            });
            nodes.push(node);
        }
        let count = reader.varint_at_most("number of a network's outputs", limits.nodes)?;
        let outputs = (0..count).map(|_| read_value(reader)).collect::<Result<Vec<_>, _>>()?;
        let network = Self { inputs, nodes, outputs };
        network.check_structure(section, name, limits)?;
        Ok(network)
    }

    /// Lengths of the weights in the stream: weight and bias of each layer.
    pub(crate) fn tensor_lengths<'a>(&'a self, name: &'a str) -> impl Iterator<Item = TensorLength<'a>> {
        self.layers().flat_map(move |layer| {
            [layer.stored_weights(), layer.outputs.into()].map(|length| TensorLength { name, length })
        })
    }

    /// The weights as a stream holds them: weight and bias of each layer, without what a mask hides.
    pub(crate) fn stored_tensors(&self) -> Vec<Vec<f32>> {
        self.layers().flat_map(|layer| [stored_weight(layer), layer.bias.clone()]).collect()
    }

    /// Takes weights as a stream holds them, of [`Network::tensor_lengths`].
    pub(crate) fn set_stored_tensors(&mut self, tensors: &mut impl Iterator<Item = Vec<f32>>) {
        for layer in self.layers_mut() {
            let weight = tensors.next().unwrap_or_default();
            layer.weight = whole_weight(layer, weight);
            layer.bias = tensors.next().unwrap_or_default();
        }
    }
}

fn read_value(reader: &mut Reader<'_>) -> Result<Value, CodecError> {
    reader.varint_at_most("a value of a network", u32::MAX).map(Value)
}

/// A node behind values of these channels.
fn read_node(
    reader: &mut Reader<'_>,
    section: &'static str,
    name: &str,
    channels: &[u64],
    limits: &Limits,
) -> Result<Node, CodecError> {
    let byte = reader.u8("operation of a node")?;
    let (code, reads_last) = (byte & !READS_LAST, byte & READS_LAST != 0);
    let count = match code {
        CONCATENATE => reader.varint_at_most("inputs of a concatenation", limits.nodes)?,
        ADD | MULTIPLY => 2,
        LINEAR..=SPREAD => 1,
        _ => return Err(CodecError::invalid(section, format!("operation of {name}"), code, "0 to 15")),
    };
    let mut inputs = Vec::new();
    for index in 0..count {
        let last = (channels.len() as u32).wrapping_sub(1);
        let value = if index == 0 && reads_last { Value(last) } else { read_value(reader)? };
        if value.0 as usize >= channels.len() {
            let expected = format!("less than {}, since a node reads only what is before it", channels.len());
            return Err(CodecError::invalid(section, format!("an input of {name}"), value.0, expected));
        }
        inputs.push(value);
    }
    let Some(&first) = inputs.first() else {
        return Err(CodecError::invalid(section, format!("number of inputs of {name}"), 0, "2 or more"));
    };
    let mut layer = |kind| -> Result<Operation, CodecError> {
        let outputs = reader.varint_at_most("outputs of a layer", limits.layer_width)?;
        let (kernel, groups) = match code {
            LINEAR => (1, 1),
            DOUBLING => (5, 1),
            _ => (
                reader.u8("kernel of a layer")?.into(),
                reader.varint_at_most("groups of a layer", limits.layer_width)?,
            ),
        };
        let inputs = u32::try_from(channels[first.0 as usize]).unwrap_or(u32::MAX);
        Ok(Operation::Layer(Layer { kind, inputs, outputs, kernel, groups, weight: Vec::new(), bias: Vec::new() }))
    };
    let operation = match code {
        LINEAR | CONVOLUTION => layer(LayerKind::Convolution)?,
        HALVING => layer(LayerKind::Halving)?,
        DOUBLING => layer(LayerKind::Doubling)?,
        CHECKERBOARD => layer(LayerKind::Checkerboard)?,
        RELU => Operation::Relu,
        LEAKY_RELU => Operation::LeakyRelu(USUAL_SLOPE),
        LEAKY_RELU_OF_SLOPE => Operation::LeakyRelu(reader.finite("slope of a leaky ReLU")?),
        RESIZE => Operation::Resize,
        MEAN_OVER_HEIGHT => Operation::MeanOverHeight,
        MEAN_OVER_WIDTH => Operation::MeanOverWidth,
        TRANSPOSE => Operation::Transpose,
        SPREAD => Operation::Spread,
        CONCATENATE => Operation::Concatenate,
        ADD => Operation::Add,
        _ => Operation::Multiply,
    };
    Ok(Node { operation, inputs })
}

/// A weight without what a mask hides.
fn stored_weight(layer: &Layer) -> Vec<f32> {
    if layer.kind != LayerKind::Checkerboard {
        return layer.weight.clone();
    }
    let kernels = layer.weight.chunks_exact((layer.kernel * layer.kernel) as usize);
    kernels.flat_map(|kernel| masked_taps(layer.kernel).map(|tap| kernel[tap])).collect()
}

/// The whole weight, zeros where it is masked.
fn whole_weight(layer: &Layer, stored: Vec<f32>) -> Vec<f32> {
    if layer.kind != LayerKind::Checkerboard {
        return stored;
    }
    let mut weight = vec![0.0; layer.weights() as usize];
    let kernels = weight.chunks_exact_mut((layer.kernel * layer.kernel) as usize);
    for (kernel, stored) in kernels.zip(stored.chunks_exact(masked_taps(layer.kernel).count())) {
        masked_taps(layer.kernel).zip(stored).for_each(|(tap, &value)| kernel[tap] = value);
    }
    weight
}
