//! A network ready to run.
//!
//! Values are computed either as whole maps, where something looks beyond one place of them, or place by place, eight
//! places at a time, where they are asked for. So a plane's network costs no more than the places that are coded by it.
//!
//! | file | what |
//! |---|---|
//! | `build.rs` | a network into a program |
//! | `run.rs` | a program over maps, or at single places |
//! | `cost.rs` | what that takes, before it is done |

mod build;
mod cost;
mod run;

pub(crate) use cost::blocks;

use std::sync::Arc;

use super::kernels::{Convolution, LANES, Lanes, MaskedConvolution, PaddedMap, TransposedConvolution};

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

/// A network that [`Network::check`] has passed, with its weights laid out.
#[derive(Debug)]
pub(crate) struct Program {
    inputs: Vec<InputKind>,
    values: Vec<ValuePlan>,
    steps: Vec<Step>,
    outputs: Vec<usize>,
    /// What makes values that are the same everywhere, and the outputs need.
    uniform: Vec<Action>,
    /// What makes the outputs at a place, after that.
    schedule: Vec<Action>,
    /// Values that are made as whole maps, in order, with what makes each.
    maps: Vec<MapPlan>,
    slots: usize,
}

/// Where a value is.
#[derive(Clone, Copy, Debug)]
struct ValuePlan {
    channels: usize,
    /// Channels that may be other than 0: the first ones.
    known: usize,
    /// Where its channels begin among the slots of a workspace.
    slot: usize,
    /// The border that its map needs, where it must be there as a map.
    border: Option<usize>,
}

/// How a value is computed from others.
#[derive(Debug)]
struct Step {
    kind: Arc<StepKind>,
    /// Values.
    inputs: Vec<usize>,
    /// What follows at once, in place.
    activation: Option<Activation>,
}

#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "a program has few steps, each allocated once")]
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
    /// It has become a part of the step before, whose value is its own.
    Merged,
}

#[derive(Clone, Copy, Debug)]
enum Activation {
    Relu,
    LeakyRelu(f32),
}

/// What happens at a place.
#[derive(Clone, Copy, Debug)]
enum Action {
    /// A value is taken from its map.
    Load(usize),
    /// A value is computed by its step.
    Run(usize),
}

#[derive(Debug)]
struct MapPlan {
    value: usize,
    /// What makes it at a place, unless its step makes the whole map.
    schedule: Option<Vec<Action>>,
    /// Maps that nobody needs after this one.
    done: Vec<usize>,
}

/// A program with everything that is computed as whole maps.
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
        Workspace { slots: vec![[0.0; LANES]; self.slots], window: Vec::new() }
    }

    /// Channels of all inputs.
    pub(crate) fn input_channels(&self) -> u64 {
        self.values[..self.inputs.len()].iter().map(|value| value.channels as u64).sum()
    }

    /// Where the numbers of an input of a pointwise program belong.
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
