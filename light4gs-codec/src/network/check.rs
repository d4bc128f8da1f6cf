//! Requirements that a network must meet before it runs.

use super::{Layer, LayerKind, Network, Operation, Value};
use crate::{CodecError, Limits, limits::at_most};

impl Operation {
    /// A name for messages.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Layer(layer) => match layer.kind {
                LayerKind::Convolution => "convolution",
                LayerKind::Halving => "halving convolution",
                LayerKind::Doubling => "doubling convolution",
                LayerKind::Checkerboard => "checkerboard convolution",
            },
            Self::Relu => "ReLU",
            Self::LeakyRelu(_) => "leaky ReLU",
            Self::Resize => "resize",
            Self::MeanOverHeight => "mean over height",
            Self::MeanOverWidth => "mean over width",
            Self::Transpose => "transpose",
            Self::Spread => "spread",
            Self::Concatenate => "concatenate",
            Self::Add => "add",
            Self::Subtract => "subtract",
            Self::Multiply => "multiply",
            Self::Divide => "divide",
            Self::Exponential => "exponential",
            Self::Logarithm => "logarithm",
            Self::SquareRoot => "square root",
            Self::Affine { .. } => "affine",
            Self::Clamp { .. } => "clamp",
            Self::GroupSum(_) => "group sum",
            Self::GroupMaximum(_) => "group maximum",
            Self::Select(_) => "select",
        }
    }

    /// Whether it combines two values, element by element.
    pub(super) fn is_binary(&self) -> bool {
        matches!(self, Self::Add | Self::Subtract | Self::Multiply | Self::Divide)
    }

    /// Channels of its result, from those of its inputs.
    pub(super) fn channels(&self, inputs: impl IntoIterator<Item = u64>) -> u64 {
        let mut inputs = inputs.into_iter();
        match self {
            Self::Layer(layer) => layer.outputs.into(),
            Self::Concatenate => inputs.fold(0, u64::saturating_add),
            Self::GroupSum(group) | Self::GroupMaximum(group) => inputs.next().unwrap_or(0) / u64::from(*group).max(1),
            Self::Select(channels) => channels.len() as u64,
            _ => inputs.next().unwrap_or(0),
        }
    }

    /// Refuses parameters that the operation cannot have. `first` is the number of channels of its first input.
    fn check_numbers(&self, first: u64, section: &'static str, name: &str) -> Result<(), CodecError> {
        let refuse = |field: &str, found: String, expected: &str| {
            Err(CodecError::invalid(section, format!("{field} of {name}"), found, expected))
        };
        match self {
            Self::LeakyRelu(slope) if !slope.is_finite() => refuse("slope", slope.to_string(), "a finite number"),
            Self::Affine { scale, offset } if !(scale.is_finite() && offset.is_finite()) => {
                refuse("scale and offset", format!("{scale} and {offset}"), "finite numbers")
            }
            Self::Clamp { least, most } if !(least.is_finite() && most.is_finite() && least <= most) => {
                refuse("range", format!("{least} to {most}"), "finite numbers, the lower one first")
            }
            Self::GroupSum(group) | Self::GroupMaximum(group)
                if *group == 0 || !first.is_multiple_of(u64::from(*group)) =>
            {
                refuse("channels of a group", group.to_string(), &format!("a divisor of {first}"))
            }
            Self::Select(channels) if channels.is_empty() => refuse("selected channels", "none".into(), "1 or more"),
            Self::Select(channels) => match channels.iter().find(|&&channel| u64::from(channel) >= first) {
                Some(beyond) => refuse("a selected channel", beyond.to_string(), &format!("less than {first}")),
                None => Ok(()),
            },
            _ => Ok(()),
        }
    }

    /// Whether it needs its input as a whole map, since it looks beyond one place.
    pub(super) fn reads_map(&self) -> bool {
        match self {
            Self::Layer(layer) => match layer.kind {
                LayerKind::Convolution => layer.kernel > 1,
                LayerKind::Halving | LayerKind::Doubling => true,
                LayerKind::Checkerboard => false,
            },
            Self::Resize | Self::MeanOverHeight | Self::MeanOverWidth | Self::Transpose | Self::Spread => true,
            _ => false,
        }
    }

    /// Whether its result is computed as a whole map, not place by place.
    pub(super) fn makes_map(&self) -> bool {
        match self {
            Self::Layer(layer) => layer.kind == LayerKind::Doubling,
            Self::Resize | Self::MeanOverHeight | Self::MeanOverWidth | Self::Transpose => true,
            _ => false,
        }
    }

    pub(super) fn reads_anchors(&self) -> bool {
        matches!(self, Self::Layer(layer) if layer.kind == LayerKind::Checkerboard)
    }

    /// The width of the border of zeros that its input needs.
    pub(super) fn border(&self) -> usize {
        match self {
            Self::Layer(layer) if layer.kind == LayerKind::Doubling => 1,
            Self::Layer(layer) => layer.kernel as usize / 2,
            _ => 0,
        }
    }
}

impl Network {
    /// Channels of every value. Every node reads only values before its own.
    pub(crate) fn channels(&self) -> Vec<u64> {
        let mut channels: Vec<u64> = self.inputs.iter().map(|&channels| channels.into()).collect();
        for node in &self.nodes {
            let own = node.operation.channels(node.inputs.iter().map(|value| channels[value.0 as usize]));
            channels.push(own);
        }
        channels
    }

    /// Numbers of all weights and biases.
    pub(crate) fn weights(&self) -> u64 {
        self.layers().fold(0u64, |sum, layer| sum.saturating_add(layer.weights()).saturating_add(layer.outputs.into()))
    }

    /// Which inputs are anchors of a checkerboard.
    pub(crate) fn anchor_inputs(&self) -> Vec<bool> {
        let reads = |value: usize| {
            self.nodes.iter().any(|node| node.operation.reads_anchors() && node.inputs[0].0 as usize == value)
        };
        (0..self.inputs.len()).map(reads).collect()
    }

    /// Refuses an illegal network, or one beyond the limits, before anything is computed. Messages call it `name`.
    pub(crate) fn check(&self, section: &'static str, name: &str, limits: &Limits) -> Result<(), CodecError> {
        self.check_structure(section, name, limits)?;
        for (index, node) in self.nodes.iter().enumerate() {
            if let Operation::Layer(layer) = &node.operation {
                check_weights(layer, section, &format!("{name}, node {index}"))?;
            }
        }
        Ok(())
    }

    /// [`Network::check`] without the weights.
    pub(crate) fn check_structure(&self, section: &'static str, name: &str, limits: &Limits) -> Result<(), CodecError> {
        let refuse = |field: String, found: String, expected: &str| {
            Err(CodecError::invalid(section, format!("{name}, {field}"), found, expected))
        };
        at_most(section, format!("{name}, number of inputs"), self.inputs.len() as u64, limits.nodes)?;
        at_most(section, format!("{name}, number of nodes"), self.nodes.len() as u64, limits.nodes)?;
        at_most(section, format!("{name}, number of outputs"), self.outputs.len() as u64, limits.nodes)?;
        if self.inputs.contains(&0) {
            return refuse("channels of an input".into(), "0".into(), "1 or more");
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let (field, operation) = (format!("node {index}"), node.operation.name());
            let arity = match node.operation {
                Operation::Concatenate => node.inputs.len().max(2),
                _ if node.operation.is_binary() => 2,
                _ => 1,
            };
            if node.inputs.len() != arity || arity > limits.nodes as usize {
                return refuse(
                    format!("inputs of {field} ({operation})"),
                    node.inputs.len().to_string(),
                    &arity.to_string(),
                );
            }
            if let Some(later) = node.inputs.iter().find(|value| value.0 as usize >= self.inputs.len() + index) {
                let expected =
                    format!("less than {}, since a node reads only values before it", self.inputs.len() + index);
                return refuse(format!("an input of {field} ({operation})"), later.0.to_string(), &expected);
            }
            if let Operation::Layer(layer) = &node.operation {
                check_layer(layer, section, &format!("{name}, {field}"), limits)?;
            }
        }
        let all = self.inputs.len() + self.nodes.len();
        if let Some(missing) = self.outputs.iter().find(|value| value.0 as usize >= all) {
            return refuse("an output".into(), missing.0.to_string(), &format!("less than {all}"));
        }
        // Concatenations may double the number of channels from node to node.
        let mut channels: Vec<u64> = self.inputs.iter().map(|&channels| channels.into()).collect();
        let mut total: u64 = channels.iter().sum();
        for (index, node) in self.nodes.iter().enumerate() {
            let of = |value: &Value| channels[value.0 as usize];
            let first = of(&node.inputs[0]);
            match &node.operation {
                Operation::Layer(layer) if first != u64::from(layer.inputs) => {
                    return refuse(format!("inputs of node {index}"), layer.inputs.to_string(), &first.to_string());
                }
                operation if operation.is_binary() && !first.is_multiple_of(of(&node.inputs[1])) => {
                    let found = of(&node.inputs[1]).to_string();
                    let expected = format!("{first}, or a divisor of it");
                    return refuse(format!("channels of the second input of node {index}"), found, &expected);
                }
                operation => operation.check_numbers(first, section, &format!("{name}, node {index}"))?,
            }
            let own = node.operation.channels(node.inputs.iter().map(of));
            channels.push(own);
            total = total.saturating_add(own);
            at_most(section, format!("{name}, channels of all values"), total, limits.layer_width)?;
        }
        at_most(section, format!("{name}, channels of all values"), total, limits.layer_width)?;
        at_most(section, format!("{name}, number of weights"), self.weights(), limits.layer_weights)?;
        self.check_anchors(section, name)
    }

    /// Anchors are half of a map. Only a checkerboard convolution can read them, and its result exists only at the
    /// other half of the places.
    fn check_anchors(&self, section: &'static str, name: &str) -> Result<(), CodecError> {
        let anchors = self.anchor_inputs();
        let mut depends = vec![false; self.inputs.len()];
        let refuse = |index: usize, found: &str, expected: &str| {
            Err(CodecError::invalid(section, format!("{name}, input of node {index}"), found, expected))
        };
        for (index, node) in self.nodes.iter().enumerate() {
            let reads = node.inputs.iter().any(|value| anchors.get(value.0 as usize).is_some_and(|&anchors| anchors));
            if node.operation.reads_anchors() != reads {
                let expected = "an input of the network that only checkerboard convolutions read";
                return refuse(index, "another value", expected);
            }
            let after = reads || node.inputs.iter().any(|value| depends[value.0 as usize]);
            if after && node.operation.reads_map() {
                return refuse(index, "half a map", "a value that does not come from anchors");
            }
            depends.push(after);
        }
        if self.outputs.iter().any(|value| anchors.get(value.0 as usize).is_some_and(|&anchors| anchors)) {
            return Err(CodecError::invalid(section, format!("{name}, an output"), "anchors", "another value"));
        }
        Ok(())
    }

    /// Refuses a network that looks at more than one place.
    pub(crate) fn check_pointwise(&self, section: &'static str, name: &str) -> Result<(), CodecError> {
        let wide = self.nodes.iter().position(|node| node.operation.reads_map() || node.operation.reads_anchors());
        match wide {
            Some(index) => {
                let found = self.nodes[index].operation.name();
                Err(CodecError::invalid(
                    section,
                    format!("{name}, node {index}"),
                    found,
                    "an operation that looks at one place only",
                ))
            }
            None => Ok(()),
        }
    }

    /// Refuses a network whose outputs differ from the expected ones in number or channels.
    pub(crate) fn check_outputs(&self, section: &'static str, name: &str, expected: &[u64]) -> Result<(), CodecError> {
        let channels = self.channels();
        let found: Vec<u64> = self.outputs.iter().map(|value| channels[value.0 as usize]).collect();
        if found == expected {
            return Ok(());
        }
        let field = format!("{name}, channels of the outputs");
        Err(CodecError::invalid(section, field, format!("{found:?}"), format!("{expected:?}")))
    }

    /// Height and width of every value, for inputs of these sizes and a target; refuses sizes that do not fit together.
    pub(crate) fn sizes(
        &self,
        section: &'static str,
        name: &str,
        inputs: &[[u32; 2]],
        target: [u32; 2],
        limits: &Limits,
    ) -> Result<Vec<[u32; 2]>, CodecError> {
        let mut sizes = inputs.to_vec();
        for (index, node) in self.nodes.iter().enumerate() {
            let of = |value: &Value| sizes[value.0 as usize];
            let [height, width] = of(&node.inputs[0]);
            let refuse = |found: [u32; 2], expected: [u32; 2]| {
                let field = format!("{name}, size at node {index} ({})", node.operation.name());
                Err(CodecError::invalid(section, field, format!("{found:?}"), format!("{expected:?}")))
            };
            let size = match &node.operation {
                Operation::Layer(layer) => match layer.kind {
                    LayerKind::Halving => [height.div_ceil(2), width.div_ceil(2)],
                    LayerKind::Doubling => [height.saturating_mul(2), width.saturating_mul(2)],
                    LayerKind::Convolution | LayerKind::Checkerboard => [height, width],
                },
                Operation::Resize => target,
                Operation::MeanOverHeight => [1, width],
                Operation::MeanOverWidth => [height, 1],
                Operation::Transpose => [width, height],
                Operation::Spread => {
                    let fits = |side: u32, target: u32| side == 1 || side == target;
                    if !(fits(height, target[0]) && fits(width, target[1])) {
                        return refuse([height, width], target);
                    }
                    target
                }
                _ => {
                    if let Some(other) = node.inputs.iter().map(of).find(|&other| other != [height, width]) {
                        return refuse(other, [height, width]);
                    }
                    [height, width]
                }
            };
            for side in size {
                at_most(section, format!("{name}, size at node {index}"), side.into(), limits.resolution)?;
            }
            sizes.push(size);
        }
        for value in &self.outputs {
            let found = sizes[value.0 as usize];
            if found != target {
                let field = format!("{name}, size of an output");
                return Err(CodecError::invalid(section, field, format!("{found:?}"), format!("{target:?}")));
            }
        }
        Ok(sizes)
    }
}

fn check_layer(layer: &Layer, section: &'static str, name: &str, limits: &Limits) -> Result<(), CodecError> {
    let Layer { kind, inputs, outputs, kernel, groups, .. } = *layer;
    let refuse = |field: &str, found: u32, expected: &str| {
        Err(CodecError::invalid(section, format!("{name}, {field}"), found, expected))
    };
    for (field, channels) in [("inputs", inputs), ("outputs", outputs)] {
        at_most(section, format!("{name}, {field}"), channels.into(), limits.layer_width)?;
        if channels == 0 {
            return refuse(field, 0, "1 or more");
        }
    }
    if groups == 0 || !inputs.is_multiple_of(groups) || !outputs.is_multiple_of(groups) {
        return refuse("groups", groups, &format!("a divisor of {inputs} inputs and {outputs} outputs"));
    }
    if kernel.is_multiple_of(2) || kernel > 7 {
        return refuse("kernel", kernel, "odd, at most 7");
    }
    match kind {
        LayerKind::Doubling if kernel != 5 => return refuse("kernel", kernel, "5, where the size doubles"),
        LayerKind::Doubling if groups != 1 => return refuse("groups", groups, "1, where the size doubles"),
        LayerKind::Checkerboard if kernel == 1 => return refuse("kernel", kernel, "3, 5 or 7, for a checkerboard"),
        _ => {}
    }
    let window = u64::from(inputs / groups) * u64::from(kernel) * u64::from(kernel);
    at_most(section, format!("{name}, weights of an output"), window, limits.layer_width)
}

fn check_weights(layer: &Layer, section: &'static str, name: &str) -> Result<(), CodecError> {
    let arrays = [("weight", &layer.weight, layer.weights()), ("bias", &layer.bias, layer.outputs.into())];
    for (what, values, count) in arrays {
        if values.len() as u64 != count {
            let field = format!("length of {name}, {what}");
            return Err(CodecError::invalid(section, field, values.len(), count.to_string()));
        }
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            let field = format!("{name}, {what}");
            return Err(CodecError::NonFinite { section, field, index, value: values[index] });
        }
    }
    Ok(())
}
