//! The cost of reading planes, known before they are read.

use super::{
    context_model::{Condition, SECTION, network_name},
    exact_model::{ExactModel, source_size},
    walk::BATCH,
};
use crate::{
    CodecError,
    budget::Budget,
    entropy::READ_NANOSECONDS,
    network::{
        blocks,
        kernels::{LANES, PaddedMap},
    },
    plane_layout::PlaneShape,
};

/// Nanoseconds of a row, besides those of its values.
const ROW_NANOSECONDS: u64 = 1000;
/// Nanoseconds to copy one channel from a condition to a distribution, or from a distribution to a row, at eight
/// places.
const CHANNEL_NANOSECONDS: u64 = 16;
/// Bytes of a value of a row that is being computed: scale, mean, level.
const ROW_BYTES: u64 = 10;

/// Asks for the memory and the time of all planes of a model; those of a stage are in memory at the same time. Refuses
/// sizes that do not fit the networks.
pub(super) fn ask(model: &ExactModel<'_>, stages: &[Vec<usize>], budget: &Budget) -> Result<(), CodecError> {
    let channels = u64::from(model.arrays.channels);
    let area = |plane: &PlaneShape| (plane.size[0] as u64).saturating_mul(plane.size[1] as u64);
    let planes = model.layout.planes().iter();
    let values = planes.fold(0u64, |sum, plane| sum.saturating_add(channels.saturating_mul(area(plane))));
    budget.things(SECTION, values, 4, READ_NANOSECONDS)?;
    let mut most = 0u64;
    for stage in stages {
        let mut memory = 0u64;
        for &plane in stage {
            memory = memory.saturating_add(ask_plane(model, plane, budget)?);
        }
        most = most.max(memory);
    }
    budget.memory(SECTION, most)
}

/// Asks for the time of one plane; returns the memory that it takes, without its values.
fn ask_plane(model: &ExactModel<'_>, plane: usize, budget: &Budget) -> Result<u64, CodecError> {
    let prior = &model.arrays.priors[model.prior_of(plane)];
    let size @ [height, width] = model.layout.planes()[plane].size.map(|side| side as u32);
    let channels = u64::from(model.arrays.channels);
    // Eight places of a row are computed at a time, in each pass.
    let passes = if prior.has_anchors() { 2 } else { 1 };
    let computed = [height, passes * (width / passes).next_multiple_of(LANES as u32)];

    let distribution = &model.distributions[model.prior_of(plane)][1];
    let mut row = ROW_NANOSECONDS + distribution.workspace_nanoseconds();
    let mut block = distribution.nanoseconds() + 2 * channels * CHANNEL_NANOSECONDS;
    let mut workspaces = distribution.workspace_bytes();
    let mut numbers = 0u64;
    for Condition { network, sources } in prior.conditions.iter().flatten() {
        let inputs: Vec<_> = sources.iter().map(|&source| source_size(source, plane, model.layout)).collect();
        let (name, program) = (network_name(*network as usize), model.condition(*network));
        let network = &model.arrays.networks[*network as usize];
        let all = network.sizes(SECTION, &name, &inputs, size, &budget.limits)?;
        let cost = program.cost(&all, computed);
        budget.time(SECTION, cost.nanoseconds)?;
        numbers = numbers.saturating_add(cost.numbers);
        row += program.workspace_nanoseconds();
        block +=
            network.outputs.iter().map(|value| network.channels()[value.0 as usize]).sum::<u64>() * CHANNEL_NANOSECONDS;
        workspaces += program.workspace_bytes();
    }
    budget.time(SECTION, u64::from(passes * height).saturating_mul(row))?;
    budget.time(SECTION, blocks(computed).saturating_mul(block))?;
    if prior.has_anchors() {
        numbers = numbers.saturating_add(PaddedMap::footprint(channels, [height, width / 2], 3));
    }
    if prior.has_latent() {
        let symbols = u64::from(model.arrays.latent_channels()) * u64::from(height / 4) * u64::from(width / 4);
        budget.time(SECTION, symbols.saturating_mul(READ_NANOSECONDS))?;
        numbers = numbers.saturating_add(symbols);
    }
    let rows = u64::from(height.min(BATCH as u32));
    let batch = rows.saturating_mul(workspaces.saturating_add(channels.saturating_mul(width.into()) * ROW_BYTES));
    Ok(numbers.saturating_mul(4).saturating_add(batch))
}
