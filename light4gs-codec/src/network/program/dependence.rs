//! Which values are computed once for all times, which once for all places, and which at each place and time.

use std::sync::Arc;

use super::{Action, InputKind, Program, Step, StepKind, ValuePlan, Workspace};
use crate::network::{
    Network, Operation,
    kernels::{Lanes, kept},
};

/// What a value of a pointwise program depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Dependence {
    time: bool,
    place: bool,
}

impl Dependence {
    /// The same at all places.
    pub(crate) const TIME: Self = Self { time: true, place: false };
    /// The same at all times.
    pub(crate) const PLACE: Self = Self { time: false, place: true };
    pub(crate) const TIME_AND_PLACE: Self = Self { time: true, place: true };
    const NOTHING: Self = Self { time: false, place: false };

    fn or(self, other: Self) -> Self {
        Self { time: self.time || other.time, place: self.place || other.place }
    }
}

/// The actions before the schedule of a program over places and times, and the values that they leave to it.
#[derive(Debug, Default)]
pub(super) struct Before {
    /// Actions for values that are the same everywhere.
    constant: Vec<Action>,
    /// Actions for values that depend on the time alone.
    time: Vec<Action>,
    /// Actions for values that depend on the place alone.
    place: Vec<Action>,
    /// The values of the place alone, inputs excepted, that the schedule or an output reads.
    kept: Vec<usize>,
    /// For each input, whether the schedule or an output reads it.
    read: Vec<bool>,
    /// For each blend, the value that holds its numbers, and the number of channels that it adds up.
    blends: Vec<(usize, usize)>,
}

impl Program {
    /// A pointwise program whose inputs depend on time or place. [`Program::workspace_over_time`] makes its memory,
    /// [`Program::run_time`] is called once for each time, and [`Program::run_place`] or [`Program::load`] at each
    /// place before [`Program::run`].
    pub(crate) fn over_time(network: &Network, inputs: &[Dependence]) -> Self {
        let kinds = vec![InputKind::Lanes; network.inputs.len()];
        let mut program = Self::new(network, kinds, &vec![true; network.inputs.len()], None);
        let dependence = program.dependence_of_values(network, inputs);
        program.find_blends(&dependence);
        program.split_schedule(&dependence);
        program.find_kept(&dependence);
        program
    }

    /// The dependence of every value: that of all that it is computed from.
    fn dependence_of_values(&self, network: &Network, inputs: &[Dependence]) -> Vec<Dependence> {
        let mut dependence = inputs.to_vec();
        for (node, step) in network.nodes.iter().zip(&self.steps) {
            let of_operands = step.inputs.iter().fold(Dependence::NOTHING, |all, &input| all.or(dependence[input]));
            // Weights of 0 times the time are 0, because the time is finite. Other values may be infinite.
            let reads_the_time = of_operands == Dependence::TIME && step.inputs[0] < inputs.len();
            let constant = reads_the_time && is_constant(&node.operation);
            dependence.push(if constant { Dependence::NOTHING } else { of_operands });
        }
        dependence
    }

    /// Moves the actions that are not needed at each place and time from the schedule to those before it.
    fn split_schedule(&mut self, dependence: &[Dependence]) {
        for action in std::mem::take(&mut self.schedule) {
            let (Action::Load(value) | Action::Run(value)) = action;
            let actions = match dependence[value] {
                Dependence::NOTHING => &mut self.before.constant,
                Dependence::TIME => &mut self.before.time,
                Dependence::PLACE => &mut self.before.place,
                _ => &mut self.schedule,
            };
            actions.push(action);
        }
    }

    /// Finds the inputs, and the values of the place alone, that the rest of the schedule and the outputs read.
    fn find_kept(&mut self, dependence: &[Dependence]) {
        let first = self.inputs.len();
        let mut read = self.read_by_schedule();
        let is_kept = |&value: &usize| read[value] && dependence[value] == Dependence::PLACE;
        self.before.kept = (first..read.len()).filter(is_kept).collect();
        read.truncate(first);
        self.before.read = read;
    }

    /// Whether the schedule or an output reads each value.
    fn read_by_schedule(&self) -> Vec<bool> {
        let operands = self.schedule.iter().filter_map(|action| match *action {
            Action::Run(value) => Some(&self.steps[value - self.inputs.len()].inputs),
            Action::Load(_) => None,
        });
        let mut read = vec![false; self.values.len()];
        operands.chain([&self.outputs]).flatten().for_each(|&value| read[value] = true);
        read
    }

    /// Replaces a sum of products by one step where one factor of each product is the same at all places.
    fn find_blends(&mut self, dependence: &[Dependence]) {
        let first = self.inputs.len();
        let mut reads = vec![0usize; self.values.len()];
        let read = self.steps.iter().map(|step| &step.inputs).chain([&self.outputs]);
        read.flatten().for_each(|&value| reads[value] += 1);
        let mut replaced = Vec::new();
        for index in 0..self.steps.len() {
            let StepKind::GroupSum(group) = *self.steps[index].kind else { continue };
            let product = self.steps[index].inputs[0];
            let Some(Step { kind, inputs, activation: None }) = product.checked_sub(first).map(|at| &self.steps[at])
            else {
                continue;
            };
            let &[numbers, weights] = &inputs[..] else { continue };
            let fits = matches!(**kind, StepKind::Multiply)
                && reads[product] == 1
                && !dependence[numbers].place
                && dependence[weights].place
                && self.values[weights].channels == group;
            if fits {
                let kind = Arc::new(StepKind::Blend(self.before.blends.len()));
                self.before.blends.push((numbers, group));
                self.steps[index] = Step { kind, inputs: vec![numbers, weights], activation: None };
                replaced.push(product);
            }
        }
        self.schedule.retain(|action| !matches!(action, Action::Run(value) if replaced.contains(value)));
    }

    /// Memory for a program over places and times, with what is the same everywhere.
    pub(crate) fn workspace_over_time(&self) -> Workspace {
        let mut workspace = self.workspace();
        workspace.blends.resize_with(self.before.blends.len(), Default::default);
        self.perform_at_places(&self.before.constant, &mut workspace);
        // Blends of constants are complete now, and what depends on the place alone may read them.
        self.set_blends(&mut workspace);
        workspace
    }

    /// Computes the values that depend on the time alone.
    pub(crate) fn run_time(&self, workspace: &mut Workspace) {
        self.perform_at_places(&self.before.time, workspace);
        self.set_blends(workspace);
    }

    fn set_blends(&self, workspace: &mut Workspace) {
        for (blend, &(numbers, group)) in workspace.blends.iter_mut().zip(&self.before.blends) {
            let ValuePlan { slot, channels, .. } = self.values[numbers];
            blend.set(&workspace.slots[slot..slot + channels], group);
        }
    }

    /// Computes the values that depend on the place alone.
    pub(crate) fn run_place(&self, workspace: &mut Workspace) {
        self.perform_at_places(&self.before.place, workspace);
    }

    /// Whether [`Program::run`] reads an input.
    pub(crate) fn reads_input(&self, input: usize) -> bool {
        self.before.read[input]
    }

    /// Channels that [`Program::save`] writes.
    pub(crate) fn kept_channels(&self) -> usize {
        self.before.kept.iter().map(|&value| self.values[value].channels).sum()
    }

    /// Appends the values of [`Program::run_place`] that [`Program::run`] reads.
    pub(crate) fn save(&self, workspace: &Workspace, to: &mut Vec<Lanes>) {
        for &value in &self.before.kept {
            let ValuePlan { slot, channels, .. } = self.values[value];
            to.extend_from_slice(&workspace.slots[slot..slot + channels]);
        }
    }

    /// Takes the values that [`Program::save`] has appended, instead of calling [`Program::run_place`].
    pub(crate) fn load(&self, mut saved: &[Lanes], workspace: &mut Workspace) {
        for &value in &self.before.kept {
            let ValuePlan { slot, channels, .. } = self.values[value];
            let (own, others) = saved.split_at(channels);
            workspace.slots[slot..slot + channels].copy_from_slice(own);
            saved = others;
        }
    }
}

/// Whether an operation gives a layer's biases, whatever finite numbers it reads.
fn is_constant(operation: &Operation) -> bool {
    matches!(operation, Operation::Layer(layer) if layer.weight.iter().all(|&weight| kept(weight) == 0.0))
}
