//! The context model, prepared for the exact executor.

use super::context_model::{Condition, PlanePrior, PlaneSource, SECTION};
use crate::{
    CodecError, ContextModelArrays, FeaturePlaneArrays,
    budget::Budget,
    entropy::Distribution,
    network::{
        Program,
        kernels::{PaddedMap, kept},
    },
    plane_layout::PlaneLayout,
};

/// The networks of a checked context model, with weights in the executor's layout.
#[derive(Debug)]
pub(super) struct ExactModel<'a> {
    pub(super) arrays: &'a ContextModelArrays,
    /// The planes that it is for.
    pub(super) layout: &'a PlaneLayout,
    pub(super) latent_distributions: Vec<Distribution>,
    /// The networks that are conditions; `None` for the others.
    conditions: Vec<Option<Program>>,
    /// The distributions of each prior: one for the anchors, for which fewer inputs are known, and one for the other
    /// places, or for all.
    pub(super) distributions: Vec<[Program; 2]>,
}

impl<'a> ExactModel<'a> {
    /// Refuses a model that takes more memory than the budget has.
    pub(super) fn new(
        arrays: &'a ContextModelArrays,
        layout: &'a PlaneLayout,
        budget: &Budget,
    ) -> Result<Self, CodecError> {
        let (mut as_distribution, mut as_condition) = (vec![0; arrays.networks.len()], vec![0; arrays.networks.len()]);
        for prior in &arrays.priors {
            // The two programs of a prior share the weights of a third one.
            as_distribution[prior.distribution as usize] += 1;
            let conditions = prior.conditions.iter().flatten();
            conditions.for_each(|condition| as_condition[condition.network as usize] = 1);
        }
        for (index, network) in arrays.networks.iter().enumerate() {
            let bytes = network.program_bytes().saturating_mul(as_distribution[index].min(1) + as_condition[index]);
            let plans = network.plan_bytes() * 2 * as_distribution[index];
            budget.things(SECTION, bytes + plans, 1, 2)?;
        }
        let all = arrays.networks.iter().enumerate().map(|(index, network)| {
            (as_distribution[index] > 0).then(|| Program::pointwise(network, &vec![true; network.inputs.len()]))
        });
        let all: Vec<Option<Program>> = all.collect();
        let distributions = arrays.priors.iter().map(|prior| {
            let index = prior.distribution as usize;
            let whole = all[index].as_ref().expect("made above for what is used");
            [false, true].map(|with_anchors| whole.with_present(&arrays.networks[index], &present(prior, with_anchors)))
        });
        let latent = arrays.latent.as_ref();
        let conditions = arrays.networks.iter().zip(as_condition);
        Ok(Self {
            distributions: distributions.collect(),
            conditions: conditions.map(|(network, used)| (used > 0).then(|| Program::over_maps(network))).collect(),
            latent_distributions: latent
                .map_or_else(Vec::new, |latent| latent.tables.iter().map(|table| table.distribution()).collect()),
            arrays,
            layout,
        })
    }

    /// A network of a [`Condition`] of this model.
    pub(super) fn condition(&self, network: u32) -> &Program {
        self.conditions[network as usize].as_ref().expect("made for every network that is a condition's")
    }

    /// The index of a plane's prior.
    pub(super) fn prior_of(&self, plane: usize) -> usize {
        self.arrays.plane_priors[plane] as usize
    }

    pub(super) fn center_of(&self, plane: usize) -> f32 {
        self.arrays.centers.of(self.layout.planes()[plane].axes)
    }

    /// The latent `[N, height, width]` from its symbols (symbol plus median), with a border.
    pub(super) fn latent(&self, symbols: &[i32], [height, width]: [usize; 2], border: usize) -> PaddedMap {
        let medians = self.arrays.latent.as_ref().map_or(&[][..], |latent| &latent.medians);
        let mut map = PaddedMap::zeros(medians.len(), height, width, border);
        for (index, row) in symbols.chunks_exact(width).enumerate() {
            let (channel, y) = (index / height, index % height);
            for (target, &symbol) in map.row_mut(channel, y).iter_mut().zip(row) {
                *target = kept(symbol as f32 + medians[channel]);
            }
        }
        map
    }

    /// A decoded plane as the input of a network.
    pub(super) fn plane(&self, decoded: &FeaturePlaneArrays, plane: usize, border: usize) -> PaddedMap {
        let center = self.center_of(plane);
        let plane = &decoded.planes[plane];
        PaddedMap::centered(&plane.values, [plane.height as usize, plane.width as usize], center, border)
    }
}

/// Which inputs of a prior's distribution are known.
fn present(prior: &PlanePrior, with_anchors: bool) -> Vec<bool> {
    let known = |condition: &Option<Condition>| {
        let reads_anchors = |condition: &Condition| condition.sources.contains(&PlaneSource::Anchors);
        condition.as_ref().is_some_and(|condition| with_anchors || !reads_anchors(condition))
    };
    prior.conditions.iter().map(known).collect()
}

/// The index of the decoded plane that is a source of a plane; `None` where the source is the plane itself or its
/// latent.
pub(super) fn source_plane(source: PlaneSource, plane: usize, layout: &PlaneLayout) -> Option<usize> {
    match source {
        PlaneSource::Latent | PlaneSource::Anchors => None,
        PlaneSource::SameScale(axes) => Some(layout.in_same_scale(plane, axes).expect("`check_planes` has seen it")),
        PlaneSource::LowerScale => Some(layout.one_scale_below(plane).expect("`check_planes` has seen it")),
    }
}

/// Height and width of a source of a plane.
pub(super) fn source_size(source: PlaneSource, plane: usize, layout: &PlaneLayout) -> [u32; 2] {
    let size = |plane: usize| layout.planes()[plane].size.map(|side| side as u32);
    match source {
        PlaneSource::Latent => size(plane).map(|side| side / 4),
        _ => size(source_plane(source, plane, layout).unwrap_or(plane)),
    }
}
