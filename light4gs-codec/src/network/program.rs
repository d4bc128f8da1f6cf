//! A network ready to run.
//!
//! Values are computed either as whole maps, where something looks beyond one place of them, or place by place, eight
//! places at a time, where they are asked for. So a plane's network costs no more than the places that are coded by it.

use std::sync::Arc;

use super::{
    Layer, LayerKind, Network, Operation,
    kernels::{
        AnchorMap, Columns, Convolution, LANES, Lanes, MaskedConvolution, PaddedMap, TransposedConvolution,
        mean_over_height, mean_over_width, resized, transposed,
    },
};

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
    /// What makes the outputs at a place.
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
    Multiply,
    /// It has become a part of the step before, whose value is its own.
    Merged,
}

#[derive(Clone, Copy, Debug)]
enum Activation {
    Relu,
    LeakyRelu(f32),
}

impl Activation {
    fn of(operation: &Operation) -> Option<Self> {
        match operation {
            Operation::Relu => Some(Self::Relu),
            Operation::LeakyRelu(slope) => Some(Self::LeakyRelu(*slope)),
            _ => None,
        }
    }

    fn apply(self, values: &mut [Lanes]) {
        let slope = match self {
            Self::Relu => {
                // Not 0 times `x`, which is no number where `x` is infinite.
                values.as_flattened_mut().iter_mut().for_each(|x| *x = if *x >= 0.0 { *x } else { 0.0 });
                return;
            }
            Self::LeakyRelu(slope) => slope,
        };
        for lanes in values {
            for value in lanes {
                *value = if *value >= 0.0 { *value } else { slope * *value };
            }
        }
    }
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
    /// A program over maps, and anchors where a checkerboard convolution reads an input.
    pub(crate) fn over_maps(network: &Network) -> Self {
        let kind = |anchors: bool| if anchors { InputKind::Anchors } else { InputKind::Map };
        let inputs = network.anchor_inputs().into_iter().map(kind).collect();
        Self::new(network, inputs, &vec![true; network.inputs.len()], None)
    }

    /// A program over numbers at single places, of a network that [`Network::check_pointwise`] has passed. Inputs that
    /// are not `present` are zeros; those that are at the end of what a layer reads take no part in its sums.
    pub(crate) fn pointwise(network: &Network, present: &[bool]) -> Self {
        Self::new(network, vec![InputKind::Lanes; network.inputs.len()], present, None)
    }

    /// This pointwise program of a network, with other inputs present.
    pub(crate) fn with_present(&self, network: &Network, present: &[bool]) -> Self {
        Self::new(network, self.inputs.clone(), present, Some(self))
    }

    /// `shared` is another program of the same network, whose weights are used.
    fn new(network: &Network, inputs: Vec<InputKind>, present: &[bool], shared: Option<&Self>) -> Self {
        let channels: Vec<usize> = network.channels().into_iter().map(|channels| channels as usize).collect();
        let mut values: Vec<ValuePlan> = Vec::with_capacity(channels.len());
        for &channels in &channels {
            let slot = values.last().map_or(0, |last| last.slot + last.channels);
            values.push(ValuePlan { channels, known: channels, slot, border: None });
        }
        for (value, &present) in values.iter_mut().zip(present) {
            value.known = if present { value.channels } else { 0 };
        }
        // Where a value is read: once is a chance to merge an activation into the step before.
        let mut reads = vec![0usize; channels.len()];
        network.nodes.iter().flat_map(|node| &node.inputs).for_each(|value| reads[value.0 as usize] += 1);
        network.outputs.iter().for_each(|value| reads[value.0 as usize] += 1);
        // The value that stands for each one.
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
                Operation::Add | Operation::Multiply => known(0).max(known(1)),
                Operation::Layer(_) => values[own].channels,
                _ => known(0),
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
        let mut program = Self { inputs, values, steps, outputs, schedule: Vec::new(), maps: Vec::new(), slots };
        program.plan();
        program
    }

    /// Finds what makes each map and the outputs, and when a map is done with.
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

    /// What makes `roots` at a place. `anew` where they are to be computed even if they have maps.
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

    /// The maps that a schedule looks at.
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

    /// Whether an input is the anchors of a checkerboard.
    pub(crate) fn reads_anchors(&self) -> bool {
        self.inputs.contains(&InputKind::Anchors)
    }

    /// The border that the map of an input needs.
    pub(crate) fn border(&self, input: usize) -> usize {
        self.values[input].border.unwrap_or(0)
    }

    /// Computes what is needed as whole maps, from a map for each input that is one, with the border of
    /// [`Program::border`], and the height and width of the target.
    pub(crate) fn maps(&self, mut maps: Vec<Option<PaddedMap>>, target: [usize; 2]) -> Maps<'_> {
        maps.resize_with(self.values.len(), || None);
        let mut workspace = self.workspace();
        for plan in &self.maps {
            let map = self.make_map(plan, &maps, target, &mut workspace);
            maps[plan.value] = Some(map);
            plan.done.iter().for_each(|&value| maps[value] = None);
        }
        Maps { program: self, maps }
    }

    /// Memory for this program.
    pub(crate) fn workspace(&self) -> Workspace {
        Workspace { slots: vec![[0.0; LANES]; self.slots], window: Vec::new() }
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

    /// Computes the outputs of a pointwise program.
    pub(crate) fn run(&self, workspace: &mut Workspace) {
        self.perform(&self.schedule, &[], None, 0, Columns { first: 0, step: 1 }, workspace);
    }

    fn perform(
        &self,
        schedule: &[Action],
        maps: &[Option<PaddedMap>],
        anchors: Option<&AnchorMap>,
        y: usize,
        columns: Columns,
        workspace: &mut Workspace,
    ) {
        let map = |value: usize| maps[value].as_ref().expect("maps are made before what reads them");
        let Workspace { slots, window } = workspace;
        for action in schedule {
            let (Action::Load(value) | Action::Run(value)) = *action;
            let ValuePlan { slot, channels, .. } = self.values[value];
            // A value's slots lie behind those of what it reads.
            let (before, own) = slots.split_at_mut(slot);
            let own = &mut own[..channels];
            if let Action::Load(_) = action {
                let map = map(value);
                own.iter_mut().enumerate().for_each(|(channel, lanes)| *lanes = map.lanes(channel, y, columns, 0, 0));
                continue;
            }
            let step = &self.steps[value - self.inputs.len()];
            let operand = |index: usize| {
                let ValuePlan { slot, channels, known, .. } = self.values[step.inputs[index]];
                (&before[slot..slot + channels], known)
            };
            match &*step.kind {
                StepKind::Pointwise(convolution) => {
                    let (inputs, known) = operand(0);
                    let used = if convolution.takes_fewer_inputs() { known } else { inputs.len() };
                    convolution.apply_pointwise(&inputs[..used], own);
                }
                StepKind::Convolution { convolution, stride } => {
                    let columns = Columns { first: stride * columns.first, step: stride * columns.step };
                    convolution.apply(map(step.inputs[0]), stride * y, columns, window, own);
                }
                StepKind::Checkerboard(convolution) => match anchors {
                    Some(anchors) => convolution.apply(anchors, y, columns.first / 2, window, own),
                    None => own.fill([0.0; LANES]),
                },
                StepKind::Activation(activation) => {
                    own.copy_from_slice(operand(0).0);
                    activation.apply(own);
                }
                StepKind::Spread => spread(map(step.inputs[0]), y, columns, own),
                StepKind::Concatenate => {
                    let mut rest = own;
                    for index in 0..step.inputs.len() {
                        let (from, known) = operand(index);
                        let (to, after) = rest.split_at_mut(from.len());
                        to[..known].copy_from_slice(&from[..known]);
                        rest = after;
                    }
                }
                StepKind::Add => combine(own, operand(0).0, operand(1).0, |a, b| a + b),
                StepKind::Multiply => combine(own, operand(0).0, operand(1).0, |a, b| a * b),
                StepKind::Doubling(_)
                | StepKind::Resize
                | StepKind::MeanOverHeight
                | StepKind::MeanOverWidth
                | StepKind::Transpose
                | StepKind::Merged => {}
            }
            if let Some(activation) = step.activation {
                activation.apply(&mut slots[slot..slot + channels]);
            }
        }
    }

    /// One value as a map, from those before it.
    fn make_map(
        &self,
        plan: &MapPlan,
        maps: &[Option<PaddedMap>],
        target: [usize; 2],
        work: &mut Workspace,
    ) -> PaddedMap {
        let ValuePlan { channels, slot, border, .. } = self.values[plan.value];
        let border = border.unwrap_or(0);
        let step = &self.steps[plan.value - self.inputs.len()];
        let input = |index: usize| maps[step.inputs[index]].as_ref().expect("maps are made in order");
        let Some(schedule) = &plan.schedule else {
            let activate =
                |values: &mut [Lanes]| step.activation.iter().for_each(|activation| activation.apply(values));
            return match &*step.kind {
                StepKind::Doubling(convolution) => convolution.apply(input(0), border, activate),
                StepKind::Resize => resized(input(0), target, border),
                StepKind::MeanOverHeight => mean_over_height(input(0), border),
                StepKind::MeanOverWidth => mean_over_width(input(0), border),
                _ => transposed(input(0), border),
            };
        };
        let [height, width] = self.size_of(plan.value, maps, target);
        let mut map = PaddedMap::zeros(channels, height, width, border);
        for y in 0..height {
            for first in (0..width).step_by(LANES) {
                self.perform(schedule, maps, None, y, Columns { first, step: 1 }, work);
                for (channel, lanes) in work.slots[slot..slot + channels].iter().enumerate() {
                    let row = &mut map.row_mut(channel, y)[first..];
                    row.iter_mut().zip(lanes).for_each(|(to, &value)| *to = value);
                }
            }
        }
        map
    }

    /// Height and width of a value whose operands lead to maps.
    fn size_of(&self, value: usize, maps: &[Option<PaddedMap>], target: [usize; 2]) -> [usize; 2] {
        let mut value = value;
        loop {
            let step = &self.steps[value - self.inputs.len()];
            let input = step.inputs[0];
            match (&*step.kind, &maps[input]) {
                (StepKind::Spread, _) => return target,
                (StepKind::Convolution { stride, .. }, Some(map)) => {
                    return [map.height, map.width].map(|side| side.div_ceil(*stride));
                }
                (_, Some(map)) => return [map.height, map.width],
                (_, None) => value = input,
            }
        }
    }

    /// What it costs to run over a target, given the sizes of all values: multiplications, or work of that size, to make
    /// all maps and the outputs everywhere; and the most numbers that its maps hold at a time.
    pub(crate) fn cost(&self, sizes: &[[u32; 2]], target: [u32; 2]) -> Cost {
        let mut cost = Cost::default();
        let first = self.inputs.len();
        let footprint = |value: usize| {
            let ValuePlan { channels, border, .. } = self.values[value];
            border.map_or(0, |border| PaddedMap::footprint(channels as u64, sizes[value], border))
        };
        let mut live: u64 = (0..first).fold(0, |sum: u64, value| sum.saturating_add(footprint(value)));
        cost.numbers = live;
        for plan in &self.maps {
            live = live.saturating_add(footprint(plan.value));
            cost.numbers = cost.numbers.max(live);
            let places = places(sizes[plan.value]);
            cost.work = cost.work.saturating_add(match &plan.schedule {
                Some(schedule) => self.work_at_place(schedule).saturating_mul(places),
                None => {
                    let step = &self.steps[plan.value - first];
                    let read = self::places(sizes[step.inputs[0]]);
                    self.step_work(plan.value).saturating_mul(places.max(read))
                }
            });
            live = plan.done.iter().fold(live, |live, &value| live.saturating_sub(footprint(value)));
        }
        let outputs = self.work_at_place(&self.schedule).saturating_mul(places(target));
        cost.work = cost.work.saturating_add(outputs);
        cost
    }

    /// Work at a single place, for programs that are not over maps.
    pub(crate) fn work(&self) -> u64 {
        self.work_at_place(&self.schedule)
    }

    fn work_at_place(&self, schedule: &[Action]) -> u64 {
        let work = |action: &Action| match *action {
            Action::Load(value) => self.values[value].channels as u64,
            Action::Run(value) => self.step_work(value),
        };
        schedule.iter().fold(0, |sum: u64, action| sum.saturating_add(work(action)))
    }

    /// Multiplications for one place of a value, or work of that size.
    fn step_work(&self, value: usize) -> u64 {
        let step = &self.steps[value - self.inputs.len()];
        let channels = self.values[value].channels as u64;
        match &*step.kind {
            StepKind::Pointwise(convolution) | StepKind::Convolution { convolution, .. } => convolution.work(),
            StepKind::Checkerboard(convolution) => convolution.work(),
            StepKind::Doubling(convolution) => convolution.work(),
            StepKind::Resize => 6 * channels,
            _ => channels,
        }
    }
}

/// What running a program takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cost {
    /// Multiplications.
    pub(crate) work: u64,
    /// Numbers in memory.
    pub(crate) numbers: u64,
}

/// Places of a map, as many as are computed: eight in a row at a time.
fn places([height, width]: [u32; 2]) -> u64 {
    u64::from(height) * u64::from(width.next_multiple_of(LANES as u32))
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
            Operation::Multiply => Self::Multiply,
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

impl Maps<'_> {
    /// The only output at `columns` of row `y`, given the anchors where the program reads any.
    pub(crate) fn output<'w>(
        &self,
        y: usize,
        columns: Columns,
        anchors: Option<&AnchorMap>,
        workspace: &'w mut Workspace,
    ) -> &'w [Lanes] {
        self.program.perform(&self.program.schedule, &self.maps, anchors, y, columns, workspace);
        self.program.output_lanes(workspace, 0)
    }

    /// Memory for [`Maps::output`].
    pub(crate) fn workspace(&self) -> Workspace {
        self.program.workspace()
    }
}

/// A map of which height or width may be 1, at places of a larger one.
fn spread(map: &PaddedMap, y: usize, columns: Columns, outputs: &mut [Lanes]) {
    let y = if map.height == 1 { 0 } else { y };
    for (channel, lanes) in outputs.iter_mut().enumerate() {
        *lanes = if map.width == 1 { [map.row(channel, y)[0]; LANES] } else { map.lanes(channel, y, columns, 0, 0) };
    }
}

fn combine(own: &mut [Lanes], a: &[Lanes], b: &[Lanes], operation: impl Fn(f32, f32) -> f32) {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    own.as_flattened_mut().iter_mut().zip(pairs).for_each(|(own, (&a, &b))| *own = operation(a, b));
}
