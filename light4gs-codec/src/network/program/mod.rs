//! A network prepared for running.
//!
//! A value is computed as a whole map if an operation that reads it looks beyond one place. Otherwise it is computed
//! place by place, eight places at a time, where it is needed. So a plane's network is run only at the places that are
//! coded with it.
//!
//! | file | what |
//! |---|---|
//! | `build.rs` | from a network to a program |
//! | `dependence.rs` | which values are computed once for all times, which once for all places |
//! | `run.rs` | a program over maps, or at single places |
//! | `cost.rs` | the cost of running it |

mod build;
mod cost;
mod dependence;
mod run;

pub(crate) use cost::blocks;
pub(crate) use dependence::Dependence;

use std::sync::Arc;

use super::kernels::{Blend, Convolution, LANES, Lanes, MaskedConvolution, PaddedMap, TransposedConvolution};

/// What an input of a program is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InputKind {
    /// A whole map.
    Map,
    /// The anchors of a checkerboard.
    Anchors,
    /// Numbers at the places that are computed.
    Lanes,
}

/// A network that [`Network::check`] has accepted, with its weights in the layout for running.
#[derive(Debug)]
pub(crate) struct Program {
    inputs: Vec<InputKind>,
    values: Vec<ValuePlan>,
    steps: Vec<Step>,
    outputs: Vec<usize>,
    /// The actions before the schedule, in a program over places and times.
    before: dependence::Before,
    /// The actions that compute the outputs at a place.
    schedule: Vec<Action>,
    /// Values that are computed as whole maps, in order, with the plan of each.
    maps: Vec<MapPlan>,
    slots: usize,
}

/// Where a value is stored.
#[derive(Clone, Copy, Debug)]
struct ValuePlan {
    channels: usize,
    /// Channels that may differ from 0: the first ones.
    known: usize,
    /// Where its channels begin among the slots of a workspace.
    slot: usize,
    /// The border of its map; `None` if it is not computed as a map.
    border: Option<usize>,
}

/// How a value is computed from others.
#[derive(Debug)]
struct Step {
    kind: Arc<StepKind>,
    /// Values.
    inputs: Vec<usize>,
    /// An activation that follows at once, in place.
    activation: Option<Activation>,
}

#[derive(Debug)]
enum StepKind {
    Pointwise(Convolution),
    Convolution {
        convolution: Convolution,
        stride: usize,
    },
    Checkerboard(MaskedConvolution),
    Doubling(TransposedConvolution),
    Activation(Activation),
    Resize,
    MeanOverHeight,
    MeanOverWidth,
    Transpose,
    Spread,
    Concatenate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Exponential,
    Logarithm,
    SquareRoot,
    Affine {
        scale: f32,
        offset: f32,
    },
    Clamp {
        least: f32,
        most: f32,
    },
    GroupSum(usize),
    GroupMaximum(usize),
    Select(Vec<u32>),
    /// A product with numbers that are the same at all places, and the sum of each of its groups. Its inputs are the
    /// numbers and the weights; the field is the index of the blend in the workspace.
    Blend(usize),
    /// Merged into the step before, which computes its value.
    Merged,
}

#[derive(Clone, Copy, Debug)]
enum Activation {
    Relu,
    LeakyRelu(f32),
}

/// An action at a place.
#[derive(Clone, Copy, Debug)]
enum Action {
    /// Read a value from its map.
    Load(usize),
    /// Compute a value by its step.
    Run(usize),
}

#[derive(Debug)]
struct MapPlan {
    value: usize,
    /// The actions that compute it at a place, unless its step computes the whole map.
    schedule: Option<Vec<Action>>,
    /// Maps that are not needed after this one.
    done: Vec<usize>,
}

/// A program with all its whole maps computed.
#[derive(Debug)]
pub(crate) struct Maps<'a> {
    program: &'a Program,
    maps: Vec<Option<PaddedMap>>,
}

/// Memory for the values of eight places.
#[derive(Debug, Default)]
pub(crate) struct Workspace {
    slots: Vec<Lanes>,
    window: Vec<Lanes>,
    blends: Vec<Blend>,
    /// Channels of a blend whose weights are not 0, and these weights.
    used: Vec<(usize, Lanes)>,
}

impl Program {
    /// Whether an input is the anchors of a checkerboard.
    pub(crate) fn reads_anchors(&self) -> bool {
        self.inputs.contains(&InputKind::Anchors)
    }

    /// The border that the map of an input needs.
    pub(crate) fn border(&self, input: usize) -> usize {
        self.values[input].border.unwrap_or(0)
    }

    /// Memory for this program.
    pub(crate) fn workspace(&self) -> Workspace {
        Workspace { slots: vec![[0.0; LANES]; self.slots], ..Workspace::default() }
    }

    /// Channels of all inputs.
    pub(crate) fn input_channels(&self) -> u64 {
        self.values[..self.inputs.len()].iter().map(|value| value.channels as u64).sum()
    }

    /// Where to write an input of a pointwise program.
    pub(crate) fn input_lanes<'w>(&self, workspace: &'w mut Workspace, input: usize) -> &'w mut [Lanes] {
        let ValuePlan { slot, channels, .. } = self.values[input];
        &mut workspace.slots[slot..slot + channels]
    }

    /// An output at the places that were computed last.
    pub(crate) fn output_lanes<'w>(&self, workspace: &'w Workspace, output: usize) -> &'w [Lanes] {
        let ValuePlan { slot, channels, .. } = self.values[self.outputs[output]];
        &workspace.slots[slot..slot + channels]
    }
}

impl Step {
    fn reads_map(&self) -> bool {
        matches!(
            *self.kind,
            StepKind::Convolution { .. }
                | StepKind::Doubling(_)
                | StepKind::Resize
                | StepKind::MeanOverHeight
                | StepKind::MeanOverWidth
                | StepKind::Transpose
                | StepKind::Spread
        )
    }

    fn makes_map(&self) -> bool {
        self.reads_map() && !matches!(*self.kind, StepKind::Convolution { .. } | StepKind::Spread)
    }
}
