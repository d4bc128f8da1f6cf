//! How planes are coded, as data.

use super::ContextModelArrays;
use crate::steps::PerGroup;

/// How the feature planes are coded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaneCoding {
    /// The networks that give distributions. They are used as the stream holds them: in the compact profile, quantized.
    pub model: ContextModelArrays,
    /// Quantization steps: one entry for all scales, or one for each.
    pub steps: Vec<PerGroup>,
    /// For each plane that has a latent, its symbols `[N, H/4, W/4]` row-major; an empty list for the others. Any
    /// integers within ±2^22 are legal; `round(h_a(P / step) - median)` gives a small file.
    pub latent_symbols: Vec<Vec<i32>>,
}

impl PlaneCoding {
    /// Channels, height and width of the latent of each plane, for planes of these sizes `[height, width]`; `None` for
    /// planes without a latent.
    ///
    /// It tells for which planes [`PlaneCoding::latent_symbols`] must not be empty.
    pub fn latent_shapes(model: &ContextModelArrays, sizes: &[[u32; 2]]) -> Vec<Option<[u32; 3]>> {
        let have = model.have_latents();
        let shape = |&[height, width]: &[u32; 2]| [model.latent_channels(), height / 4, width / 4];
        have.into_iter().zip(sizes).map(|(has_latent, size)| has_latent.then(|| shape(size))).collect()
    }
}
