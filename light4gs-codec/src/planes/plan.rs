//! The order in which planes are coded.

use super::context_model::levels;
use crate::{ContextModelArrays, plane_layout::PlaneLayout};

/// The planes in the order in which they are coded, in stages (the rounds of `docs/format.md`): planes of a stage need
/// only planes of the stages before. The model must have been checked for these planes.
pub(crate) fn stages(model: &ContextModelArrays, layout: &PlaneLayout) -> Vec<Vec<usize>> {
    let mut stages = Vec::new();
    for scale in 0..layout.scales() {
        let levels = levels(model, layout, scale).expect("`check_planes` has looked at the order");
        for level in 0..=levels.iter().copied().max().unwrap_or(0) {
            let planes = layout.scale(scale).zip(&levels).filter(|(_, own)| **own == level);
            stages.push(planes.map(|(plane, _)| plane).collect());
        }
    }
    stages
}

/// The number of sub-streams of a plane: of the latent, of the anchors, of the others.
pub(crate) fn sub_streams(model: &ContextModelArrays, plane: usize) -> usize {
    let prior = model.prior(plane);
    1 + usize::from(prior.has_latent()) + usize::from(prior.has_anchors())
}

/// The planes in the order of the stream, each with its first sub-stream.
pub(crate) fn stream_order(model: &ContextModelArrays, layout: &PlaneLayout) -> Vec<(usize, usize)> {
    let mut start = 0;
    let order = stages(model, layout).into_iter().flatten().map(|plane| {
        let first = start;
        start += sub_streams(model, plane);
        (plane, first)
    });
    order.collect()
}
