//! The context model, ready for the exact executor.

use crate::{
    ContextModelArrays, ContextModelShape,
    context_model::CONTEXT_PREDICTION,
    entropy::Distribution,
    executor::{Convolution, EntropyParameters, HyperSynthesis, MaskedConvolution, PaddedMap},
};

/// The networks of a context model whose arrays are sound, with weights laid out for the executor.
#[derive(Debug)]
pub(super) struct ExactModel {
    pub(super) shape: ContextModelShape,
    pub(super) synthesis: Option<HyperSynthesis>,
    pub(super) hyper_distributions: Vec<Distribution>,
    hyper_medians: Vec<f32>,
    pub(super) context_prediction: Option<MaskedConvolution>,
    pub(super) inter_plane: Option<Convolution>,
    pub(super) inter_scale: Option<Convolution>,
    pub(super) entropy_parameters: EntropyParameters,
}

impl ExactModel {
    pub(super) fn new(model: &ContextModelArrays) -> Self {
        let parts = model.shape.parts;
        let head = ["entropy_parameters.0", "entropy_parameters.2", "entropy_parameters.4"];
        Self {
            shape: model.shape,
            synthesis: parts
                .hyperprior
                .then(|| HyperSynthesis::new(["h_s.0", "h_s.2", "h_s.4"].map(|name| model.layer(name)))),
            hyper_distributions: model.hyper_tables.iter().map(|table| table.distribution()).collect(),
            hyper_medians: model.hyper_medians.clone(),
            context_prediction: parts.checkerboard.then(|| MaskedConvolution::new(model.layer(CONTEXT_PREDICTION))),
            inter_plane: parts.inter_plane.then(|| Convolution::new(model.layer("inter_plane"))),
            inter_scale: parts.inter_scale.then(|| Convolution::new(model.layer("inter_scale"))),
            entropy_parameters: EntropyParameters::new(head.map(|name| model.layer(name))),
        }
    }

    /// The hyperprior `[N, height, width]` of its symbols: symbol plus median.
    pub(super) fn hyperprior(&self, symbols: &[i32], [height, width]: [usize; 2]) -> PaddedMap {
        let mut map = PaddedMap::zeros(self.hyper_medians.len(), height, width, 1);
        for (index, row) in symbols.chunks_exact(width).enumerate() {
            let (channel, y) = (index / height, index % height);
            for (target, &symbol) in map.row_mut(channel, y).iter_mut().zip(row) {
                *target = symbol as f32 + self.hyper_medians[channel];
            }
        }
        map
    }
}
