//! Scales and means of a row of a plane.

use super::{
    exact_model::ExactModel,
    plan::{PlanePlan, Source},
};
use crate::{
    HexPlaneArrays,
    executor::{
        AnchorMap, Columns, Convolution, LANES, Lanes, PaddedMap, first_anchor, spread_time_means, time_means, upsample,
    },
};

/// A mean beyond this, or one that is no number, counts as 0: the symbol must stay one that float32 can hold.
const MEAN_LIMIT: f32 = 1_048_576.0;

/// The positions of a row that are coded in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// All of them.
    All,
    /// Those whose row and column have an odd sum.
    Anchors,
    /// The others.
    Others,
}

impl Part {
    /// First column and distance of the columns of row `y`.
    pub(super) fn columns(self, y: usize) -> Columns {
        match self {
            Self::All => Columns { first: 0, step: 1 },
            Self::Anchors => Columns { first: first_anchor(y), step: 2 },
            Self::Others => Columns { first: 1 - first_anchor(y), step: 2 },
        }
    }

    pub(super) fn count(self, width: usize) -> usize {
        if self == Self::All { width } else { width / 2 }
    }
}

/// Half of the input of `entropy_parameters`, `[2M]` at each position.
enum Conditions<'a> {
    Zeros,
    Convolved(&'a Convolution, PaddedMap),
}

impl<'a> Conditions<'a> {
    fn of(convolution: &'a Option<Convolution>, map: impl FnOnce(usize) -> PaddedMap) -> Self {
        let convolution = convolution.as_ref().expect("a plan asks for parts that the model has");
        Self::Convolved(convolution, map(convolution.border()))
    }

    fn fill(&self, y: usize, columns: Columns, window: &mut Vec<Lanes>, outputs: &mut [Lanes]) {
        match self {
            Self::Zeros => outputs.fill([0.0; LANES]),
            Self::Convolved(convolution, map) => convolution.apply(map, y, columns, window, outputs),
        }
    }
}

/// Scales as the network gives them, and usable means, of one row, `[M, positions]` each.
#[derive(Debug)]
pub(super) struct RowParameters {
    pub(super) scales: Vec<f32>,
    pub(super) means: Vec<f32>,
}

/// What is known about one plane before its own values.
pub(super) struct PlaneParameters<'a> {
    model: &'a ExactModel,
    parameters: Conditions<'a>,
    context: Conditions<'a>,
    width: usize,
}

impl<'a> PlaneParameters<'a> {
    /// From the planes that `plan` asks for, which are decoded, and the hyperprior where it asks for one.
    pub(super) fn new(
        model: &'a ExactModel,
        plan: &PlanePlan,
        size: [usize; 2],
        decoded: &HexPlaneArrays,
        hyperprior: Option<PaddedMap>,
    ) -> Self {
        let synthesised = |hyper: Option<PaddedMap>| match (&model.synthesis, hyper) {
            (Some(synthesis), Some(hyper)) => Conditions::Convolved(synthesis.last(), synthesis.expand(&hyper)),
            _ => Conditions::Zeros,
        };
        let centre = model.shape.centres.of(plan.space_time);
        let lower = |index: usize| {
            let plane = &decoded.planes[index];
            Conditions::of(&model.inter_scale, |border| {
                upsample(&plane.values, [plane.height as usize, plane.width as usize], size, centre, border)
            })
        };
        let mut context = Conditions::Zeros;
        let parameters = match plan.source {
            Source::Nothing => Conditions::Zeros,
            Source::Hyperprior => synthesised(hyperprior),
            Source::LowerScale(index) => lower(index),
            Source::HyperpriorAndLowerScale(index) => {
                context = lower(index);
                synthesised(hyperprior)
            }
            Source::TimePlanes(indices) => {
                let [first, second] = indices.map(|index| {
                    let plane = &decoded.planes[index];
                    let size = [plane.height as usize, plane.width as usize];
                    time_means(&plane.values, size, model.shape.centres.space_time)
                });
                Conditions::of(&model.inter_plane, |border| spread_time_means(&first, &second, size, border))
            }
        };
        Self { model, parameters, context, width: size[1] }
    }

    /// Scales and means of the positions of row `y` that belong to `part`. `anchors` are needed for the others alone.
    pub(super) fn row(&self, y: usize, part: Part, anchors: Option<&AnchorMap>) -> RowParameters {
        let channels = self.model.shape.channels as usize;
        let count = part.count(self.width);
        let mut row = RowParameters { scales: vec![0.0; channels * count], means: vec![0.0; channels * count] };
        let (mut window, mut hidden) = (Vec::new(), Default::default());
        let mut inputs = vec![[0.0; LANES]; 4 * channels];
        let mut outputs = vec![[0.0; LANES]; 2 * channels];
        let Columns { first: first_column, step } = part.columns(y);
        for first in (0..count).step_by(LANES) {
            let columns = Columns { first: first_column + step * first, step };
            let (parameters, context) = inputs.split_at_mut(2 * channels);
            self.parameters.fill(y, columns, &mut window, parameters);
            let has_context = match (&self.model.context_prediction, anchors, &self.context) {
                (Some(prediction), Some(anchors), _) => {
                    prediction.apply(anchors, y, first, &mut window, context);
                    true
                }
                (_, _, Conditions::Zeros) => false,
                (_, _, conditions) => {
                    conditions.fill(y, columns, &mut window, context);
                    true
                }
            };
            let used = if has_context { 4 * channels } else { 2 * channels };
            self.model.entropy_parameters.apply(&inputs[..used], &mut hidden, &mut outputs);

            let (scales, means) = outputs.split_at(channels);
            let lanes = LANES.min(count - first);
            for channel in 0..channels {
                let at = channel * count + first;
                row.scales[at..at + lanes].copy_from_slice(&scales[channel][..lanes]);
                let bounded = means[channel].map(bounded_mean);
                row.means[at..at + lanes].copy_from_slice(&bounded[..lanes]);
            }
        }
        row
    }
}

/// A mean that a network gives, or 0 where that is not usable.
pub(crate) fn bounded_mean(mean: f32) -> f32 {
    if mean.abs() <= MEAN_LIMIT { mean } else { 0.0 }
}
