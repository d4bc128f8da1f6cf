//! From a network to a program.

use std::sync::Arc;

use super::{Action, Activation, InputKind, MapPlan, Program, Step, StepKind, ValuePlan, dependence::Before};
use crate::network::{
    Layer, LayerKind, Network, Node, Operation,
    kernels::{Convolution, MaskedConvolution, TransposedConvolution, kept},
};

impl Program {
    /// A program over maps, and over anchors where a checkerboard convolution reads an input.
    pub(crate) fn over_maps(network: &Network) -> Self {
        let kind = |anchors: bool| if anchors { InputKind::Anchors } else { InputKind::Map };
        let inputs = network.anchor_inputs().into_iter().map(kind).collect();
        Self::new(network, inputs, &vec![true; network.inputs.len()], None)
    }

    /// A program over numbers at single places, of a network that [`Network::check_pointwise`] has accepted. Inputs
    /// that are not `present` are zeros; at the end of a layer's inputs they are left out of the sums.
    pub(crate) fn pointwise(network: &Network, present: &[bool]) -> Self {
        Self::new(network, vec![InputKind::Lanes; network.inputs.len()], present, None)
    }

    /// The same pointwise program, with other inputs present.
    pub(crate) fn with_present(&self, network: &Network, present: &[bool]) -> Self {
        Self::new(network, self.inputs.clone(), present, Some(self))
    }

    /// `shared` is another program of the same network; the new program uses its weights.
    pub(super) fn new(network: &Network, inputs: Vec<InputKind>, present: &[bool], shared: Option<&Self>) -> Self {
        let mut builder = Builder::new(network, inputs, present);
        for (index, node) in network.nodes.iter().enumerate() {
            if let Some((layer, activation)) = builder.activation_of_layer(node) {
                builder.merge(layer, activation);
            } else {
                let kind = match shared {
                    Some(program) => Arc::clone(&program.steps[index].kind),
                    None => Arc::new(StepKind::of(&node.operation)),
                };
                builder.append(node, kind);
            }
        }
        builder.finish()
    }

    /// Finds the actions that compute each map and the outputs, and after which map each map can be freed.
    fn plan(&mut self) {
        self.schedule = self.schedule_of(&self.outputs, false);
        let first = self.inputs.len();
        let mut maps = Vec::new();
        for value in first..self.values.len() {
            let step = &self.steps[value - first];
            if self.values[value].border.is_none() || matches!(*step.kind, StepKind::Merged) {
                continue;
            }
            let schedule = (!step.makes_map()).then(|| self.schedule_of(&[value], true));
            maps.push(MapPlan { value, schedule, done: Vec::new() });
        }
        let mut last_use = vec![None; self.values.len()];
        for (index, map) in maps.iter().enumerate() {
            let read = match &map.schedule {
                Some(schedule) => self.maps_read(schedule),
                None => self.steps[map.value - first].inputs.clone(),
            };
            read.into_iter().for_each(|value| last_use[value] = Some(index));
        }
        for value in self.maps_read(&self.schedule) {
            last_use[value] = None;
        }
        for (value, last) in last_use.into_iter().enumerate() {
            if let Some(index) = last {
                maps[index].done.push(value);
            }
        }
        self.maps = maps;
    }

    /// The actions that compute `roots` at a place. With `anew` they are computed even if they have maps.
    fn schedule_of(&self, roots: &[usize], anew: bool) -> Vec<Action> {
        let first = self.inputs.len();
        let mut needed = vec![false; self.values.len()];
        roots.iter().for_each(|&root| needed[root] = true);
        let mut actions = Vec::new();
        for value in (0..self.values.len()).rev() {
            if !needed[value] {
                continue;
            }
            if self.values[value].border.is_some() && !(anew && roots.contains(&value)) {
                actions.push(Action::Load(value));
            } else if let Some(step) = value.checked_sub(first).map(|index| &self.steps[index]) {
                actions.push(Action::Run(value));
                if !step.reads_map() && !matches!(*step.kind, StepKind::Checkerboard(_)) {
                    step.inputs.iter().for_each(|&input| needed[input] = true);
                }
            }
        }
        actions.reverse();
        actions
    }

    /// The maps that a schedule reads.
    fn maps_read(&self, schedule: &[Action]) -> Vec<usize> {
        let read = schedule.iter().filter_map(|action| match *action {
            Action::Load(value) => Some(value),
            Action::Run(value) => {
                let step = &self.steps[value - self.inputs.len()];
                step.reads_map().then(|| step.inputs[0])
            }
        });
        read.collect()
    }
}

/// A program of which the steps up to some node are there.
struct Builder<'a> {
    network: &'a Network,
    inputs: Vec<InputKind>,
    values: Vec<ValuePlan>,
    steps: Vec<Step>,
    /// How often each value is read.
    reads: Vec<usize>,
    /// The value that stands for each one: itself, or the layer that its activation was merged into.
    stand_ins: Vec<usize>,
}

impl<'a> Builder<'a> {
    fn new(network: &'a Network, inputs: Vec<InputKind>, present: &[bool]) -> Self {
        let values = planned_values(network, present);
        let stand_ins = (0..values.len()).collect();
        let steps = Vec::with_capacity(network.nodes.len());
        Self { network, inputs, values, steps, reads: times_read(network), stand_ins }
    }

    /// The layer and the activation, where a node is an activation that can be merged into the layer before it: no other
    /// node reads the layer, and it has no activation yet.
    fn activation_of_layer(&self, node: &Node) -> Option<(usize, Activation)> {
        let activation = Activation::of(&node.operation)?;
        let given = node.inputs[0].0 as usize;
        let layer = self.stand_ins[given];
        let index = layer.checked_sub(self.inputs.len())?;
        let fits = self.reads[given] == 1
            && matches!(self.network.nodes[index].operation, Operation::Layer(_))
            && self.steps[index].activation.is_none();
        fits.then_some((layer, activation))
    }

    /// The next node becomes the activation of a layer.
    fn merge(&mut self, layer: usize, activation: Activation) {
        let own = self.next_value();
        self.stand_ins[own] = layer;
        self.steps[layer - self.inputs.len()].activation = Some(activation);
        self.steps.push(Step { kind: Arc::new(StepKind::Merged), inputs: Vec::new(), activation: None });
    }

    /// The next node becomes a step.
    fn append(&mut self, node: &Node, kind: Arc<StepKind>) {
        let own = self.next_value();
        let operands: Vec<usize> = node.inputs.iter().map(|value| self.stand_ins[value.0 as usize]).collect();
        if node.operation.reads_map() {
            let border = &mut self.values[operands[0]].border;
            *border = Some(border.unwrap_or(0).max(node.operation.border()));
        }
        if node.operation.makes_map() {
            self.values[own].border = Some(0);
        }
        self.values[own].known = self.known_channels(&node.operation, own, &operands);
        self.steps.push(Step { kind, inputs: operands, activation: None });
    }

    /// The value of the next node.
    fn next_value(&self) -> usize {
        self.inputs.len() + self.steps.len()
    }

    /// The channels of a value that may differ from 0, counted from the first one: [`ValuePlan::known`].
    fn known_channels(&self, operation: &Operation, own: usize, operands: &[usize]) -> usize {
        let operand = |index: usize| &self.values[operands[index]];
        match operation {
            Operation::Concatenate => known_of_concatenation(operands.iter().map(|&value| &self.values[value])),
            Operation::Add | Operation::Multiply if operand(0).channels == operand(1).channels => {
                operand(0).known.max(operand(1).known)
            }
            Operation::Relu
            | Operation::LeakyRelu(_)
            | Operation::Resize
            | Operation::MeanOverHeight
            | Operation::MeanOverWidth
            | Operation::Transpose
            | Operation::Spread => operand(0).known,
            _ => self.values[own].channels,
        }
    }

    fn finish(mut self) -> Program {
        for (value, kind) in self.values.iter_mut().zip(&self.inputs) {
            if *kind == InputKind::Map {
                value.border = Some(value.border.unwrap_or(0));
            }
        }
        let outputs = self.network.outputs.iter().map(|value| self.stand_ins[value.0 as usize]).collect();
        let slots = self.values.last().map_or(0, |last| last.slot + last.channels);
        let Self { inputs, values, steps, .. } = self;
        let (schedule, maps) = (Vec::new(), Vec::new());
        let mut program = Program { inputs, values, steps, outputs, before: Before::default(), schedule, maps, slots };
        program.plan();
        program
    }
}

/// A plan for each value, one behind the other in the slots. No channel of an absent input is known.
fn planned_values(network: &Network, present: &[bool]) -> Vec<ValuePlan> {
    let mut slot = 0;
    let mut values: Vec<ValuePlan> = Vec::new();
    for channels in network.channels() {
        let channels = channels as usize;
        values.push(ValuePlan { channels, known: channels, slot, border: None });
        slot += channels;
    }
    for (value, _) in values.iter_mut().zip(present).filter(|(_, present)| !**present) {
        value.known = 0;
    }
    values
}

/// How often the nodes and the outputs read each value.
fn times_read(network: &Network) -> Vec<usize> {
    let mut reads = vec![0; network.inputs.len() + network.nodes.len()];
    let by_nodes = network.nodes.iter().flat_map(|node| &node.inputs);
    by_nodes.chain(&network.outputs).for_each(|value| reads[value.0 as usize] += 1);
    reads
}

/// Up to the last operand with a known channel, all channels count.
fn known_of_concatenation<'v>(operands: impl Iterator<Item = &'v ValuePlan>) -> usize {
    let (mut offset, mut known) = (0, 0);
    for operand in operands {
        if operand.known > 0 {
            known = offset + operand.known;
        }
        offset += operand.channels;
    }
    known
}

impl Activation {
    fn of(operation: &Operation) -> Option<Self> {
        match operation {
            Operation::Relu => Some(Self::Relu),
            Operation::LeakyRelu(slope) => Some(Self::LeakyRelu(*slope)),
            _ => None,
        }
    }
}

impl StepKind {
    fn of(operation: &Operation) -> Self {
        match operation {
            Operation::Layer(layer) => Self::of_layer(layer),
            Operation::Relu => Self::Activation(Activation::Relu),
            Operation::LeakyRelu(slope) => Self::Activation(Activation::LeakyRelu(*slope)),
            Operation::Resize => Self::Resize,
            Operation::MeanOverHeight => Self::MeanOverHeight,
            Operation::MeanOverWidth => Self::MeanOverWidth,
            Operation::Transpose => Self::Transpose,
            Operation::Spread => Self::Spread,
            Operation::Concatenate => Self::Concatenate,
            Operation::Add => Self::Add,
            Operation::Subtract => Self::Subtract,
            Operation::Multiply => Self::Multiply,
            Operation::Divide => Self::Divide,
            Operation::Exponential => Self::Exponential,
            Operation::Logarithm => Self::Logarithm,
            Operation::SquareRoot => Self::SquareRoot,
            &Operation::Affine { scale, offset } => Self::Affine { scale: kept(scale), offset: kept(offset) },
            &Operation::Clamp { least, most } => Self::Clamp { least: kept(least), most: kept(most) },
            Operation::GroupSum(group) => Self::GroupSum(*group as usize),
            Operation::GroupMaximum(group) => Self::GroupMaximum(*group as usize),
            Operation::Select(channels) => Self::Select(channels.clone()),
        }
    }

    fn of_layer(layer: &Layer) -> Self {
        match layer.kind {
            LayerKind::Convolution if layer.kernel == 1 => Self::Pointwise(Convolution::new(layer)),
            LayerKind::Convolution => Self::Convolution { convolution: Convolution::new(layer), stride: 1 },
            LayerKind::Halving => Self::Convolution { convolution: Convolution::new(layer), stride: 2 },
            LayerKind::Doubling => Self::Doubling(TransposedConvolution::new(layer)),
            LayerKind::Checkerboard => Self::Checkerboard(MaskedConvolution::new(layer)),
        }
    }
}
