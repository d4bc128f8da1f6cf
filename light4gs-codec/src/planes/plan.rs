//! When each plane is coded.

use super::context_model::levels;
use crate::{ContextModelArrays, plane_layout::PLANES_PER_SCALE};

/// The planes in the order in which they are coded, by stages: those of a stage need only planes of the stages before.
/// The model is sound.
pub(crate) fn stages(model: &ContextModelArrays, scales: usize) -> Vec<Vec<usize>> {
    let mut stages = Vec::new();
    for scale in 0..scales {
        let first = PLANES_PER_SCALE * scale;
        let priors = std::array::from_fn(|position| model.prior(first + position));
        let levels = levels(&priors).expect("`check` has looked at the order");
        for level in 0..=levels.into_iter().max().unwrap_or(0) {
            let planes = levels.iter().enumerate().filter(|(_, own)| **own == level);
            stages.push(planes.map(|(position, _)| first + position).collect());
        }
    }
    stages
}

/// Sub-streams of a plane: the latent's, the anchors', that of the others.
pub(crate) fn sub_streams(model: &ContextModelArrays, plane: usize) -> usize {
    let prior = model.prior(plane);
    1 + usize::from(prior.has_latent()) + usize::from(prior.has_anchors())
}

/// The planes in the order of the stream, each with its first sub-stream.
pub(crate) fn stream_order(model: &ContextModelArrays, scales: usize) -> Vec<(usize, usize)> {
    let mut start = 0;
    let order = stages(model, scales).into_iter().flatten().map(|plane| {
        let first = start;
        start += sub_streams(model, plane);
        (plane, first)
    });
    order.collect()
}
