//! A program over maps, or at single places.

use super::{Action, Activation, MapPlan, Maps, Program, StepKind, ValuePlan, Workspace};
use crate::network::kernels::{
    AnchorMap, Columns, LANES, Lanes, PaddedMap, exponential, kept, logarithm, mean_over_height, mean_over_width,
    resized, transposed,
};
use crate::vectors::vectorized;

impl Program {
    /// Computes the whole maps. `maps` has a map for each input that is one, with the border of [`Program::border`];
    /// `target` is the height and width of the target.
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

    /// Computes the outputs of a pointwise program.
    pub(crate) fn run(&self, workspace: &mut Workspace) {
        self.perform_at_places(&self.schedule, workspace);
    }

    pub(super) fn perform_at_places(&self, schedule: &[Action], workspace: &mut Workspace) {
        self.perform(schedule, &[], None, 0, Columns { first: 0, step: 1 }, workspace);
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
        vectorized(
            #[inline(always)]
            || self.perform_in_vectors(schedule, maps, anchors, y, columns, workspace),
        );
    }

    #[inline(always)]
    fn perform_in_vectors(
        &self,
        schedule: &[Action],
        maps: &[Option<PaddedMap>],
        anchors: Option<&AnchorMap>,
        y: usize,
        columns: Columns,
        workspace: &mut Workspace,
    ) {
        let map = |value: usize| maps[value].as_ref().expect("maps are made before what reads them");
        let Workspace { slots, window, blends, used } = workspace;
        for action in schedule {
            let (Action::Load(value) | Action::Run(value)) = *action;
            let ValuePlan { slot, channels, .. } = self.values[value];
            // A value's slots come after those of its inputs.
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
                StepKind::Subtract => combine(own, operand(0).0, operand(1).0, |a, b| a - b),
                StepKind::Multiply => combine(own, operand(0).0, operand(1).0, |a, b| a * b),
                StepKind::Divide => combine(own, operand(0).0, operand(1).0, |a, b| a / b),
                StepKind::Exponential => change(own, operand(0).0, exponential),
                StepKind::Logarithm => change(own, operand(0).0, logarithm),
                StepKind::SquareRoot => change(own, operand(0).0, f32::sqrt),
                &StepKind::Affine { scale, offset } => change(own, operand(0).0, |x| x * scale + offset),
                &StepKind::Clamp { least, most } => change(own, operand(0).0, |x| clamped(x, least, most)),
                StepKind::GroupSum(group) => reduce(own, operand(0).0, *group, |sum, x| sum + x),
                StepKind::GroupMaximum(group) => {
                    reduce(own, operand(0).0, *group, |largest, x| if x > largest { x } else { largest });
                }
                StepKind::Select(channels) => {
                    let from = operand(0).0;
                    own.iter_mut().zip(channels).for_each(|(own, &channel)| *own = from[channel as usize]);
                }
                StepKind::Blend(index) => blends[*index].apply(operand(1).0, used, own),
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

    /// Computes one value as a map, from the values before it.
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
                StepKind::Doubling(convolution) => vectorized(
                    #[inline(always)]
                    || convolution.apply(input(0), border, activate),
                ),
                StepKind::Resize => vectorized(
                    #[inline(always)]
                    || resized(input(0), target, border),
                ),
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

    /// Height and width of a value, from the maps that it is computed from.
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
}

impl Activation {
    #[inline(always)]
    fn apply(self, values: &mut [Lanes]) {
        let slope = match self {
            Self::Relu => {
                // Not 0 times `x`, which is NaN where `x` is infinite.
                values.as_flattened_mut().iter_mut().for_each(|x| *x = if *x >= 0.0 { *x } else { 0.0 });
                return;
            }
            Self::LeakyRelu(slope) => kept(slope),
        };
        for lanes in values {
            for value in lanes {
                *value = if *value >= 0.0 { *value } else { kept(slope * *value) };
            }
        }
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

/// A map whose height or width may be 1, at places of a larger map.
#[inline(always)]
fn spread(map: &PaddedMap, y: usize, columns: Columns, outputs: &mut [Lanes]) {
    let y = if map.height == 1 { 0 } else { y };
    for (channel, lanes) in outputs.iter_mut().enumerate() {
        *lanes = if map.width == 1 { [map.row(channel, y)[0]; LANES] } else { map.lanes(channel, y, columns, 0, 0) };
    }
}

/// Element by element; `b` may have fewer channels, which are repeated.
#[inline(always)]
fn combine(own: &mut [Lanes], a: &[Lanes], b: &[Lanes], operation: impl Fn(f32, f32) -> f32) {
    for (own, a) in own.chunks_exact_mut(b.len()).zip(a.chunks_exact(b.len())) {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        own.as_flattened_mut().iter_mut().zip(pairs).for_each(|(own, (&a, &b))| *own = kept(operation(a, b)));
    }
}

/// Number by number.
#[inline(always)]
fn change(own: &mut [Lanes], from: &[Lanes], operation: impl Fn(f32) -> f32) {
    let numbers = own.as_flattened_mut().iter_mut().zip(from.as_flattened());
    numbers.for_each(|(own, &x)| *own = kept(operation(x)));
}

/// Reduces each group of neighboring channels to one, from the first to the last.
#[inline(always)]
fn reduce(own: &mut [Lanes], from: &[Lanes], group: usize, operation: impl Fn(f32, f32) -> f32) {
    for (own, group) in own.iter_mut().zip(from.chunks_exact(group)) {
        *own = group[0];
        for lanes in &group[1..] {
            own.iter_mut().zip(lanes).for_each(|(own, &x)| *own = operation(*own, x));
        }
        *own = own.map(kept);
    }
}

/// NaN stays NaN.
#[inline(always)]
fn clamped(x: f32, least: f32, most: f32) -> f32 {
    if x < least {
        least
    } else if x > most {
        most
    } else {
        x
    }
}
