//! From a network to a program.

use std::sync::Arc;

use super::{Action, Activation, InputKind, MapPlan, Program, Step, StepKind, ValuePlan, dependence::Before};
use crate::network::{
    Layer, LayerKind, Network, Operation,
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

    /// `shared` is another program of the same network, whose weights are used.
    pub(super) fn new(network: &Network, inputs: Vec<InputKind>, present: &[bool], shared: Option<&Self>) -> Self {
        let channels: Vec<usize> = network.channels().into_iter().map(|channels| channels as usize).collect();
        let mut values: Vec<ValuePlan> = Vec::with_capacity(channels.len());
        for &channels in &channels {
            let slot = values.last().map_or(0, |last| last.slot + last.channels);
            values.push(ValuePlan { channels, known: channels, slot, border: None });
        }
        for (value, &present) in values.iter_mut().zip(present) {
            value.known = if present { value.channels } else { 0 };
        }
        // How often each value is read. If it is once, an activation can be merged into the step before.
        let mut reads = vec![0usize; channels.len()];
        network.nodes.iter().flat_map(|node| &node.inputs).for_each(|value| reads[value.0 as usize] += 1);
        network.outputs.iter().for_each(|value| reads[value.0 as usize] += 1);
        // The value that replaces each one.
        let mut stands: Vec<usize> = (0..channels.len()).collect();
        let mut steps: Vec<Step> = Vec::with_capacity(network.nodes.len());
        for (index, node) in network.nodes.iter().enumerate() {
            let own = inputs.len() + index;
            let given: Vec<usize> = node.inputs.iter().map(|value| value.0 as usize).collect();
            let operands: Vec<usize> = given.iter().map(|&value| stands[value]).collect();
            if let Some(activation) = Activation::of(&node.operation)
                && let Some(before) = operands[0].checked_sub(inputs.len())
                && reads[given[0]] == 1
                && matches!(network.nodes[before].operation, Operation::Layer(_))
                && steps[before].activation.is_none()
            {
                steps[before].activation = Some(activation);
                stands[own] = operands[0];
                steps.push(Step { kind: Arc::new(StepKind::Merged), inputs: Vec::new(), activation: None });
                continue;
            }
            if node.operation.reads_map() {
                let border = &mut values[operands[0]].border;
                *border = Some(border.unwrap_or(0).max(node.operation.border()));
            }
            if node.operation.makes_map() {
                values[own].border = Some(0);
            }
            let known = |value: usize| values[operands[value]].known;
            values[own].known = match &node.operation {
                Operation::Concatenate => {
                    let (mut offset, mut known) = (0, 0);
                    for &operand in &operands {
                        if values[operand].known > 0 {
                            known = offset + values[operand].known;
                        }
                        offset += values[operand].channels;
                    }
                    known
                }
                Operation::Add | Operation::Multiply
                    if values[operands[0]].channels == values[operands[1]].channels =>
                {
                    known(0).max(known(1))
                }
                Operation::Relu
                | Operation::LeakyRelu(_)
                | Operation::Resize
                | Operation::MeanOverHeight
                | Operation::MeanOverWidth
                | Operation::Transpose
                | Operation::Spread => known(0),
                _ => values[own].channels,
            };
            let kind = match shared {
                Some(program) => Arc::clone(&program.steps[index].kind),
                None => Arc::new(StepKind::of(&node.operation)),
            };
            steps.push(Step { kind, inputs: operands, activation: None });
        }
        for (value, kind) in values.iter_mut().zip(&inputs) {
            if *kind == InputKind::Map {
                value.border = Some(value.border.unwrap_or(0));
            }
        }
        let outputs = network.outputs.iter().map(|value| stands[value.0 as usize]).collect();
        let slots = values.last().map_or(0, |last| last.slot + last.channels);
        let (schedule, maps) = (Vec::new(), Vec::new());
        let mut program = Self { inputs, values, steps, outputs, before: Before::default(), schedule, maps, slots };
        program.plan();
        program
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
