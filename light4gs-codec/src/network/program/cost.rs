//! The cost of running a program, known before it runs: nanoseconds on one thread, and numbers in memory.
//!
//! The rates were measured on a server core of 2023 (`calibration.rs`) and rounded up, so that real time stays below a
//! limit on these nanoseconds. They are the same on every machine: whether a file is within a limit must not depend on
//! the machine that reads it.

use super::{Action, Program, StepKind, ValuePlan};
use crate::network::{
    LayerKind, Network, Operation,
    kernels::{Convolution, LANES, PaddedMap, TransposedConvolution},
};

/// The cost of running a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cost {
    /// On one thread.
    pub(crate) nanoseconds: u64,
    /// Numbers in memory.
    pub(crate) numbers: u64,
}

/// Nanoseconds of one action at eight places, besides those of its channels.
const ACTION: u64 = 16;
/// Nanoseconds of a channel at eight places: to compute it from as many others, to read it from a map, to write it to a
/// map.
const ELEMENT: u64 = 6;
const LOAD: u64 = 12;
const STORE: u64 = 20;
/// The same for divisions and square roots, for exponentials and logarithms.
const DIVISION: u64 = 16;
const ELEMENTARY: u64 = 80;
/// The same for whole maps: interpolation, sums over rows and columns, exchange of rows and columns.
const RESIZE: u64 = 80;
const MEAN: u64 = 20;
const TRANSPOSE: u64 = 160;
/// The scattered output of a doubling convolution.
const SCATTER: u64 = 40;
/// Nanoseconds to allocate the values of eight places, for each channel.
const WORKSPACE: u64 = 6;

impl Program {
    /// The time to compute all maps, and the outputs at all places of a target; and the largest number of numbers in
    /// its maps at a time. `sizes` are those of all values.
    pub(crate) fn cost(&self, sizes: &[[u32; 2]], target: [u32; 2]) -> Cost {
        let mut cost = Cost::default();
        let first = self.inputs.len();
        let footprint = |value: usize| {
            let ValuePlan { channels, border, .. } = self.values[value];
            border.map_or(0, |border| PaddedMap::footprint(channels as u64, sizes[value], border))
        };
        let mut live: u64 = (0..first).fold(0, |sum: u64, value| sum.saturating_add(footprint(value)));
        cost.numbers = live;
        // Filling the maps of the inputs.
        cost.nanoseconds = live.saturating_mul(4);
        for plan in &self.maps {
            live = live.saturating_add(footprint(plan.value));
            cost.numbers = cost.numbers.max(live);
            let channels = self.values[plan.value].channels as u64;
            let own = blocks(sizes[plan.value]);
            let time = match &plan.schedule {
                Some(schedule) => {
                    let stored = STORE.saturating_mul(channels);
                    self.nanoseconds_of(schedule).saturating_add(stored).saturating_mul(own)
                }
                None => {
                    let read = blocks(sizes[self.steps[plan.value - first].inputs[0]]);
                    self.step_nanoseconds(plan.value).saturating_mul(own.max(read))
                }
            };
            let zeros = footprint(plan.value).saturating_mul(2);
            cost.nanoseconds = cost.nanoseconds.saturating_add(time).saturating_add(zeros);
            live = plan.done.iter().fold(live, |live, &value| live.saturating_sub(footprint(value)));
        }
        let outputs = self.nanoseconds_of(&self.schedule).saturating_mul(blocks(target));
        cost.nanoseconds = cost.nanoseconds.saturating_add(outputs);
        cost
    }

    /// Nanoseconds at eight places, for pointwise programs.
    pub(crate) fn nanoseconds(&self) -> u64 {
        self.nanoseconds_of(&self.schedule)
    }

    /// Nanoseconds to allocate a workspace.
    pub(crate) fn workspace_nanoseconds(&self) -> u64 {
        100 + WORKSPACE * self.slots as u64
    }

    /// Bytes of a workspace.
    pub(crate) fn workspace_bytes(&self) -> u64 {
        // The window of a convolution is as long as the weights of one of its outputs; its vector grows by doubling.
        let window = self.steps.iter().map(|step| step.kind.window()).max().unwrap_or(0);
        (self.slots as u64 + 2 * window) * size_of::<[f32; LANES]>() as u64 + 128
    }

    fn nanoseconds_of(&self, schedule: &[Action]) -> u64 {
        let time = |action: &Action| match *action {
            Action::Load(value) => ACTION + LOAD * self.values[value].channels as u64,
            Action::Run(value) => self.step_nanoseconds(value),
        };
        schedule.iter().fold(0, |sum: u64, action| sum.saturating_add(time(action)))
    }

    /// Nanoseconds for eight places of a value.
    fn step_nanoseconds(&self, value: usize) -> u64 {
        let step = &self.steps[value - self.inputs.len()];
        let channels = self.values[value].channels as u64;
        let operation = match &*step.kind {
            StepKind::Pointwise(convolution) => convolution.pointwise_nanoseconds(),
            StepKind::Convolution { convolution, .. } => convolution.nanoseconds(),
            StepKind::Checkerboard(convolution) => convolution.nanoseconds(),
            StepKind::Doubling(convolution) => convolution.nanoseconds().saturating_add(SCATTER * channels),
            StepKind::Resize => RESIZE * channels,
            StepKind::MeanOverHeight | StepKind::MeanOverWidth => MEAN * channels,
            StepKind::Transpose => TRANSPOSE * channels,
            StepKind::Spread => LOAD * channels,
            StepKind::Divide | StepKind::SquareRoot => DIVISION * channels,
            StepKind::Exponential | StepKind::Logarithm => ELEMENTARY * channels,
            StepKind::GroupSum(group) | StepKind::GroupMaximum(group) => {
                ELEMENT * (channels * *group as u64 + channels)
            }
            _ => ELEMENT * channels,
        };
        let activation = if step.activation.is_some() { ELEMENT * channels } else { 0 };
        operation.saturating_add(activation).saturating_add(ACTION)
    }
}

impl Network {
    /// Bytes of a [`Program`] of this network, including the weights in their layout.
    pub(crate) fn program_bytes(&self) -> u64 {
        let weights = self.layers().fold(0u64, |sum, layer| {
            sum.saturating_add(match layer.kind {
                LayerKind::Doubling => TransposedConvolution::bytes(layer),
                _ => Convolution::bytes(layer),
            })
        });
        weights.saturating_add(self.plan_bytes())
    }

    /// Bytes of a [`Program`] without its weights: each value has a plan, a step, and actions in the schedule of each
    /// map.
    pub(crate) fn plan_bytes(&self) -> u64 {
        let values = (self.inputs.len() + self.nodes.len()) as u64;
        let selected = self.nodes.iter().map(|node| match &node.operation {
            Operation::Select(channels) => 4 * channels.len() as u64,
            _ => 0,
        });
        values * (400 + 8 * values) + selected.sum::<u64>()
    }
}

impl StepKind {
    /// Channels times taps that an output reads.
    fn window(&self) -> u64 {
        match self {
            Self::Convolution { convolution, .. } => convolution.window(),
            Self::Checkerboard(convolution) => convolution.window(),
            Self::Doubling(convolution) => convolution.window(),
            _ => 0,
        }
    }
}

/// Groups of eight neighboring places in a row, in which a map is computed.
pub(crate) fn blocks([height, width]: [u32; 2]) -> u64 {
    u64::from(height) * u64::from(width.div_ceil(LANES as u32))
}
