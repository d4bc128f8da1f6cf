//! How a scene is to be compressed.

use crate::{
    ContextModelArrays, ShCoding, attributes::AttributeSteps, network_weights::WeightPrecision,
    plane_layout::PLANES_PER_SCALE,
};

/// What a compressed stream keeps in full precision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Everything is quantized and entropy coded. Gaussians come back in another order.
    #[default]
    Compact,
    /// As in the paper: planes and spherical harmonics are entropy coded; the other attributes of the Gaussians and all
    /// network weights stay float32.
    Paper,
}

impl Profile {
    /// A name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compact => "compact",
            Self::Paper => "paper",
        }
    }
}

/// How [`crate::encode_compressed`] codes a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct CompressionInput {
    /// What stays in full precision.
    pub profile: Profile,
    /// The coding of the planes; float32 where there is none.
    pub planes: Option<PlaneCoding>,
    /// The coding of the spherical harmonics beyond degree 0.
    pub sh: ShCoding,
    /// How finely the other attributes of the Gaussians are quantized, in the compact profile.
    pub attributes: AttributeSteps,
    /// How finely weights are quantized, in the compact profile.
    pub weights: WeightPrecisions,
}

/// How finely the weights of each kind of network are quantized.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightPrecisions {
    /// Of what moves the Gaussians, whose errors show in the image.
    pub motion: WeightPrecision,
    /// Of the context model, whose errors only cost bits.
    pub context_model: WeightPrecision,
    /// Of the networks of the spherical harmonics, likewise.
    pub sh: WeightPrecision,
}

impl Default for WeightPrecisions {
    fn default() -> Self {
        let [motion, context_model, sh] = [10, 8, 8].map(WeightPrecision::Bits);
        Self { motion, context_model, sh }
    }
}

/// How the hexplane is coded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaneCoding {
    /// The networks that give distributions. They are used as the stream holds them, that is, quantized in the compact
    /// profile.
    pub model: ContextModelArrays,
    /// Quantization steps, for all scales or one entry a scale.
    pub steps: Vec<PerGroup>,
    /// For each plane that has a latent its symbols `[N, H/4, W/4]` row-major, an empty list for the others. Any
    /// integers within ±2^22 are legal; good ones are `round(h_a(P / step) - median)`.
    pub latent_symbols: Vec<Vec<i32>>,
}

impl PlaneCoding {
    /// Channels, height and width of the latent of each plane of a hexplane with these plane sizes `[height, width]`;
    /// nothing for planes that have none.
    ///
    /// This says where [`PlaneCoding::latent_symbols`] must not be empty.
    pub fn latent_shapes(model: &ContextModelArrays, sizes: &[[u32; 2]]) -> Vec<Option<[u32; 3]>> {
        let have = model.have_latents(sizes.len() / PLANES_PER_SCALE);
        let shape = |&[height, width]: &[u32; 2]| [model.latent_channels(), height / 4, width / 4];
        have.into_iter().zip(sizes).map(|(has_latent, size)| has_latent.then(|| shape(size))).collect()
    }
}

/// A number for the planes over space and one for the planes over an axis and time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerGroup {
    /// For xy, xz and yz.
    pub space_only: f32,
    /// For xt, yt and zt.
    pub space_time: f32,
}

impl PerGroup {
    pub(crate) fn of(self, space_time: bool) -> f32 {
        if space_time { self.space_time } else { self.space_only }
    }
}
