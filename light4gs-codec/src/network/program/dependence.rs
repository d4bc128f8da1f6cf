//! What is computed once for all times, once for all places, and at each place and time.

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

/// What comes before the schedule of a program over places and times, and which values these actions leave to it.
#[derive(Debug, Default)]
pub(super) struct Before {
    /// The actions that compute what is the same everywhere.
    constant: Vec<Action>,
    /// Those for what depends on the time alone, and which the outputs need.
    time: Vec<Action>,
    /// Those for what depends on the place alone.
    place: Vec<Action>,
    /// What the schedule and the outputs read of the place alone, inputs excepted.
    kept: Vec<usize>,
    /// Inputs that the schedule or an output reads.
    read: Vec<bool>,
    /// Values that are the numbers of blends, and how many channels a blend adds up.
    blends: Vec<(usize, usize)>,
}

impl Program {
    /// A pointwise program whose inputs depend on time or place. [`Program::workspace_over_time`] makes its memory,
    /// [`Program::run_time`] is called once for each time, and [`Program::run_place`] or [`Program::load`] at each
    /// place before [`Program::run`].
    pub(crate) fn over_time(network: &Network, inputs: &[Dependence]) -> Self {
        let kinds = vec![InputKind::Lanes; network.inputs.len()];
        let mut program = Self::new(network, kinds, &vec![true; network.inputs.len()], None);
        let mut dependence = inputs.to_vec();
        for (node, step) in network.nodes.iter().zip(&program.steps) {
            let constant = is_constant(&node.operation) && dependence[step.inputs[0]] == Dependence::TIME;
            dependence.push(match step.inputs[..] {
                // The time is finite, so products with 0 are 0.
                [time] if constant && time < inputs.len() => Dependence::NOTHING,
                _ => step.inputs.iter().fold(Dependence::NOTHING, |all, &input| all.or(dependence[input])),
            });
        }
        program.find_blends(&dependence);
        for action in std::mem::take(&mut program.schedule) {
            let (Action::Load(value) | Action::Run(value)) = action;
            let actions = match dependence[value] {
                Dependence::NOTHING => &mut program.before.constant,
                Dependence::TIME => &mut program.before.time,
                Dependence::PLACE => &mut program.before.place,
                _ => &mut program.schedule,
            };
            actions.push(action);
        }
        let steps = program.schedule.iter().filter_map(|action| match *action {
            Action::Run(value) => Some(&program.steps[value - inputs.len()].inputs),
            Action::Load(_) => None,
        });
        let mut read = vec![false; program.values.len()];
        steps.chain([&program.outputs]).flatten().for_each(|&value| read[value] = true);
        let is_kept = |&value: &usize| read[value] && dependence[value] == Dependence::PLACE;
        program.before.kept = (inputs.len()..read.len()).filter(is_kept).collect();
        read.truncate(inputs.len());
        program.before.read = read;
        program
    }

    /// Sums of products with what is the same at all places become one step each.
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

    /// Computes what depends on the time alone.
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

    /// Computes what depends on the place alone.
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

    /// Appends what [`Program::run_place`] has computed for [`Program::run`].
    pub(crate) fn save(&self, workspace: &Workspace, to: &mut Vec<Lanes>) {
        for &value in &self.before.kept {
            let ValuePlan { slot, channels, .. } = self.values[value];
            to.extend_from_slice(&workspace.slots[slot..slot + channels]);
        }
    }

    /// Takes what [`Program::save`] has appended, in place of [`Program::run_place`].
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
