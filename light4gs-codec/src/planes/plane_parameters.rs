//! Scales and means of a row of a plane.

use super::{
    context_model::PlaneSource,
    exact_model::{ExactModel, source_plane},
};
use crate::{
    FeaturePlaneArrays,
    network::{
        Maps,
        kernels::{AnchorMap, Columns, LANES, first_anchor},
    },
};

/// A mean beyond this, or NaN, is replaced by 0: the symbol must stay within the exact integers of float32.
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
    /// First column, and distance of the columns, of this part of row `y`.
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

/// Scales as the network gives them, and usable means, of one row, `[M, positions]` each.
#[derive(Debug)]
pub(super) struct RowParameters {
    pub(super) scales: Vec<f32>,
    pub(super) means: Vec<f32>,
}

/// What is known about a plane before its own values.
pub(super) struct PlaneParameters<'a> {
    model: &'a ExactModel<'a>,
    prior: usize,
    /// One for each input of the prior's distribution.
    conditions: Vec<Option<KnownCondition<'a>>>,
    width: usize,
}

/// A condition, and what is computed for it beforehand.
struct KnownCondition<'a> {
    maps: Maps<'a>,
    reads_anchors: bool,
}

impl<'a> PlaneParameters<'a> {
    /// From the planes that the plane's prior reads, already decoded, and the symbols of its latent, if it has one.
    pub(super) fn new(
        model: &'a ExactModel<'a>,
        plane: usize,
        size: [usize; 2],
        decoded: &FeaturePlaneArrays,
        latent_symbols: &[i32],
    ) -> Self {
        let prior = model.prior_of(plane);
        let known = |condition: &super::Condition| {
            let program = model.condition(condition.network);
            let map = |(input, &source): (usize, &PlaneSource)| {
                let border = program.border(input);
                match source {
                    PlaneSource::Latent => Some(model.latent(latent_symbols, size.map(|side| side / 4), border)),
                    // Anchors are given row by row.
                    _ => source_plane(source, plane, model.layout).map(|plane| model.plane(decoded, plane, border)),
                }
            };
            let maps = condition.sources.iter().enumerate().map(map).collect();
            KnownCondition { maps: program.maps(maps, size), reads_anchors: program.reads_anchors() }
        };
        let conditions =
            model.arrays.priors[prior].conditions.iter().map(|condition| condition.as_ref().map(known)).collect();
        Self { model, prior, conditions, width: size[1] }
    }

    /// Scales and means of the positions of row `y` that belong to `part`. `anchors` are needed only for
    /// [`Part::Others`].
    pub(super) fn row(&self, y: usize, part: Part, anchors: Option<&AnchorMap>) -> RowParameters {
        let channels = self.model.arrays.channels as usize;
        let count = part.count(self.width);
        let mut row = RowParameters { scales: vec![0.0; channels * count], means: vec![0.0; channels * count] };
        let distribution = &self.model.distributions[self.prior][usize::from(part != Part::Anchors)];
        let mut workspace = distribution.workspace();
        let mut conditions: Vec<_> = self
            .conditions
            .iter()
            .enumerate()
            .filter_map(|(input, condition)| condition.as_ref().map(|condition| (input, condition)))
            .filter(|(_, condition)| part != Part::Anchors || !condition.reads_anchors)
            .map(|(input, condition)| (input, condition, condition.maps.workspace()))
            .collect();
        let Columns { first: first_column, step } = part.columns(y);
        for first in (0..count).step_by(LANES) {
            let columns = Columns { first: first_column + step * first, step };
            for (input, condition, own) in &mut conditions {
                let said = condition.maps.output(y, columns, anchors, own);
                distribution.input_lanes(&mut workspace, *input).copy_from_slice(said);
            }
            distribution.run(&mut workspace);
            let (scales, means) = distribution.output_lanes(&workspace, 0).split_at(channels);
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

/// The mean that a network gives, or 0 where it is not usable.
pub(crate) fn bounded_mean(mean: f32) -> f32 {
    if mean.abs() <= MEAN_LIMIT { mean } else { 0.0 }
}
