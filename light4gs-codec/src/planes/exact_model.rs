//! The context model, ready for the exact executor.

use super::context_model::{Condition, PlanePrior, PlaneSource, SECTION, network_name};
use crate::{
    CodecError, ContextModelArrays, HexPlaneArrays, Limits,
    entropy::Distribution,
    limits::at_most,
    network::{
        Program,
        kernels::{LANES, PaddedMap},
    },
    plane_layout::{PLANES_PER_SCALE, is_space_time, position_of, scale_of},
};

/// The networks of a context model whose arrays are sound, with weights laid out for the executor.
#[derive(Debug)]
pub(super) struct ExactModel<'a> {
    pub(super) arrays: &'a ContextModelArrays,
    pub(super) latent_distributions: Vec<Distribution>,
    /// The networks as conditions.
    pub(super) conditions: Vec<Program>,
    /// The distributions of each prior: for the anchors, who know less, and for the others, or all.
    pub(super) distributions: Vec<[Program; 2]>,
}

impl<'a> ExactModel<'a> {
    pub(super) fn new(arrays: &'a ContextModelArrays) -> Self {
        let all = arrays.networks.iter().enumerate().map(|(index, network)| {
            let used = arrays.priors.iter().any(|prior| prior.distribution as usize == index);
            used.then(|| Program::pointwise(network, &vec![true; network.inputs.len()]))
        });
        let all: Vec<Option<Program>> = all.collect();
        let distributions = arrays.priors.iter().map(|prior| {
            let index = prior.distribution as usize;
            let whole = all[index].as_ref().expect("made above for what is used");
            [false, true].map(|with_anchors| whole.with_present(&arrays.networks[index], &present(prior, with_anchors)))
        });
        let latent = arrays.latent.as_ref();
        Self {
            distributions: distributions.collect(),
            conditions: arrays.networks.iter().map(Program::over_maps).collect(),
            latent_distributions: latent
                .map_or_else(Vec::new, |latent| latent.tables.iter().map(|table| table.distribution()).collect()),
            arrays,
        }
    }

    /// The place of a plane's prior.
    pub(super) fn prior_of(&self, plane: usize) -> usize {
        let priors = if scale_of(plane) == 0 { &self.arrays.lowest } else { &self.arrays.higher };
        priors[position_of(plane)] as usize
    }

    pub(super) fn center_of(&self, plane: usize) -> f32 {
        self.arrays.centers.of(is_space_time(plane))
    }

    /// The latent `[N, height, width]` of its symbols, symbol plus median, with a border.
    pub(super) fn latent(&self, symbols: &[i32], [height, width]: [usize; 2], border: usize) -> PaddedMap {
        let medians = self.arrays.latent.as_ref().map_or(&[][..], |latent| &latent.medians);
        let mut map = PaddedMap::zeros(medians.len(), height, width, border);
        for (index, row) in symbols.chunks_exact(width).enumerate() {
            let (channel, y) = (index / height, index % height);
            for (target, &symbol) in map.row_mut(channel, y).iter_mut().zip(row) {
                *target = symbol as f32 + medians[channel];
            }
        }
        map
    }

    /// A decoded plane as networks see it.
    pub(super) fn plane(&self, decoded: &HexPlaneArrays, plane: usize, border: usize) -> PaddedMap {
        let center = self.center_of(plane);
        let plane = &decoded.planes[plane];
        PaddedMap::centered(&plane.values, [plane.height as usize, plane.width as usize], center, border)
    }

    /// Refuses planes that are more work than the limits allow, and sizes that do not fit the networks.
    pub(super) fn check_cost(
        &self,
        stages: &[Vec<usize>],
        sizes: &[[u32; 2]],
        limits: &Limits,
    ) -> Result<(), CodecError> {
        let mut work = 0u64;
        for stage in stages {
            let mut numbers = 0u64;
            for &plane in stage {
                let prior = &self.arrays.priors[self.prior_of(plane)];
                let [height, width] = sizes[plane];
                // Eight places of a row are computed at a time, in each pass.
                let passes = if prior.has_anchors() { 2 } else { 1 };
                let places = u64::from(height) * u64::from(passes * (width / passes).next_multiple_of(LANES as u32));
                let own = self.distributions[self.prior_of(plane)][1].work().saturating_mul(places);
                work = work.saturating_add(own);
                for Condition { network, sources } in prior.conditions.iter().flatten() {
                    let network = *network as usize;
                    let inputs: Vec<_> = sources.iter().map(|&source| source_size(source, plane, sizes)).collect();
                    let name = network_name(network);
                    let all = self.arrays.networks[network].sizes(SECTION, &name, &inputs, sizes[plane], limits)?;
                    let cost = self.conditions[network].cost(&all, sizes[plane]);
                    work = work.saturating_add(cost.work.saturating_mul(passes.into()));
                    numbers = numbers.saturating_add(cost.numbers);
                }
            }
            let field = "number of values between layers";
            at_most(SECTION, field, numbers, 4 * limits.coded_values)?;
        }
        at_most(SECTION, "number of multiplications", work, limits.multiplications)
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

/// Height and width of a source of a plane.
fn source_size(source: PlaneSource, plane: usize, sizes: &[[u32; 2]]) -> [u32; 2] {
    match source {
        PlaneSource::Latent => sizes[plane].map(|side| side / 4),
        PlaneSource::Anchors => sizes[plane],
        PlaneSource::SameScale(position) => sizes[plane - position_of(plane) + usize::from(position)],
        PlaneSource::LowerScale => sizes[plane - PLANES_PER_SCALE],
    }
}
