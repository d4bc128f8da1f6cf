//! A network as bytes: its description, and, elsewhere in the section, the weights of its layers in order.

use super::{Layer, LayerKind, Network, Node, Operation, Value, kernels::masked_taps};
use crate::{
    CodecError, Limits,
    bytes::{Reader, Writer},
    limits::at_most,
    network::{tensors::StoredTensor, weights::TensorLength},
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
const SUBTRACT: u8 = 16;
const DIVIDE: u8 = 17;
const EXPONENTIAL: u8 = 18;
const LOGARITHM: u8 = 19;
const SQUARE_ROOT: u8 = 20;
const AFFINE: u8 = 21;
const CLAMP: u8 = 22;
const GROUP_SUM: u8 = 23;
const GROUP_MAXIMUM: u8 = 24;
const SELECT: u8 = 25;
/// Set in the code of an operation whose first input is the value just before its own.
const READS_LAST: u8 = 0x80;
/// The slope of [`LEAKY_RELU`].
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
            Self::Subtract => SUBTRACT,
            Self::Divide => DIVIDE,
            Self::Exponential => EXPONENTIAL,
            Self::Logarithm => LOGARITHM,
            Self::SquareRoot => SQUARE_ROOT,
            Self::Affine { .. } => AFFINE,
            Self::Clamp { .. } => CLAMP,
            Self::GroupSum(_) => GROUP_SUM,
            Self::GroupMaximum(_) => GROUP_MAXIMUM,
            Self::Select(_) => SELECT,
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
                Operation::Affine { scale: one, offset: other } | Operation::Clamp { least: one, most: other } => {
                    writer.f32(*one);
                    writer.f32(*other);
                }
                Operation::GroupSum(group) | Operation::GroupMaximum(group) => writer.varint((*group).into()),
                Operation::Select(channels) => write_selection(channels, writer),
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
        // A selection can be longer than its bytes, so the sum of all selections is bounded while they are read.
        let mut selected = 0;
        let count = reader.varint_at_most("number of a network's nodes", limits.nodes)?;
        let mut nodes = Vec::new();
        for index in 0..count as usize {
            let node = read_node(reader, section, &format!("{name}, node {index}"), &channels, limits)?;
            if let Operation::Select(channels) = &node.operation {
                selected += channels.len() as u64;
                at_most(section, format!("{name}, selected channels"), selected, limits.layer_width)?;
            }
            // If these are too many, the check below has a better message.
            let own = node.operation.channels(node.inputs.iter().map(|value| channels[value.0 as usize]));
            channels.push(own);
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

    /// The weights as a stream holds them: weight and bias of each layer, without masked numbers.
    pub(crate) fn stored_tensors(&self) -> Vec<StoredTensor> {
        let weight = |layer: &Layer| {
            let values = stored_weight(layer);
            StoredTensor { row: values.len() / (layer.outputs as usize).max(1), values }
        };
        let bias = |layer: &Layer| StoredTensor { row: layer.bias.len(), values: layer.bias.clone() };
        self.layers().flat_map(|layer| [weight(layer), bias(layer)]).collect()
    }

    /// Sets the weights from the form that a stream holds, of lengths [`Network::tensor_lengths`].
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

/// Reads a node; `channels` are those of the values before it.
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
        ADD | MULTIPLY | SUBTRACT | DIVIDE => 2,
        LINEAR..=SPREAD | EXPONENTIAL..=SELECT => 1,
        _ => return Err(CodecError::invalid(section, format!("operation of {name}"), code, "0 to 25")),
    };
    let mut inputs = Vec::new();
    for index in 0..count {
        let last = (channels.len() as u32).wrapping_sub(1);
        let value = if index == 0 && reads_last { Value(last) } else { read_value(reader)? };
        if value.0 as usize >= channels.len() {
            let expected = format!("less than {}, since a node reads only values before it", channels.len());
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
        MULTIPLY => Operation::Multiply,
        SUBTRACT => Operation::Subtract,
        DIVIDE => Operation::Divide,
        EXPONENTIAL => Operation::Exponential,
        LOGARITHM => Operation::Logarithm,
        SQUARE_ROOT => Operation::SquareRoot,
        AFFINE => {
            let scale = reader.finite("scale of an affine operation")?;
            Operation::Affine { scale, offset: reader.finite("offset of an affine operation")? }
        }
        CLAMP => {
            let least = reader.finite("lower end of a clamp")?;
            Operation::Clamp { least, most: reader.finite("upper end of a clamp")? }
        }
        GROUP_SUM => Operation::GroupSum(reader.varint_at_most("channels of a group", limits.layer_width)?),
        GROUP_MAXIMUM => Operation::GroupMaximum(reader.varint_at_most("channels of a group", limits.layer_width)?),
        _ => Operation::Select(read_selection(reader, limits)?),
    };
    Ok(Node { operation, inputs })
}

/// Channels as runs of successive numbers: the first of each run, and its length.
fn write_selection(channels: &[u32], writer: &mut Writer) {
    let runs: Vec<&[u32]> = channels.chunk_by(|a, b| a.checked_add(1) == Some(*b)).collect();
    writer.varint(runs.len() as u64);
    for run in runs {
        writer.varint(run[0].into());
        writer.varint(run.len() as u64);
    }
}

fn read_selection(reader: &mut Reader<'_>, limits: &Limits) -> Result<Vec<u32>, CodecError> {
    let mut channels = Vec::new();
    for _ in 0..reader.varint_at_most("runs of selected channels", limits.layer_width)? {
        let first = reader.varint_at_most("a selected channel", limits.layer_width)?;
        let room = limits.layer_width - channels.len() as u32;
        let length = reader.varint_at_most("length of a run of selected channels", room)?;
        channels.extend(first..first.saturating_add(length));
    }
    Ok(channels)
}

/// A weight without its masked numbers.
fn stored_weight(layer: &Layer) -> Vec<f32> {
    if layer.kind != LayerKind::Checkerboard {
        return layer.weight.clone();
    }
    let kernels = layer.weight.chunks_exact((layer.kernel * layer.kernel) as usize);
    kernels.flat_map(|kernel| masked_taps(layer.kernel).map(|tap| kernel[tap])).collect()
}

/// The whole weight, with zeros where it is masked.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A few bytes may ask for many channels, and then for as many again.
    #[test]
    fn selections_are_bounded_before_they_are_made() {
        let limits = Limits::default();
        let most = limits.layer_width / 2 + 1;
        let mut writer = Writer::default();
        writer.varint(1);
        writer.varint(most.into());
        writer.varint(200);
        for _ in 0..200 {
            writer.u8(SELECT);
            writer.varint(0);
            write_selection(&(0..most).collect::<Vec<_>>(), &mut writer);
        }
        let read = |bytes: &[u8]| Network::read(&mut Reader::new("motion", bytes), "motion", "the network", &limits);
        let error = read(&writer.bytes).unwrap_err().to_string();
        assert!(error.contains("the network, selected channels"), "{error}");
        // One run that is beyond the limit.
        let mut writer = Writer::default();
        [1, 1, 1].into_iter().for_each(|number| writer.varint(number));
        writer.u8(SELECT);
        [0, 2, 0, limits.layer_width.into(), 0, 1].into_iter().for_each(|number| writer.varint(number));
        let error = read(&writer.bytes).unwrap_err().to_string();
        assert!(error.contains("length of a run of selected channels"), "{error}");
    }
}
