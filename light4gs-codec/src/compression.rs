//! How a scene is to be compressed.

use crate::{
    ContextModelArrays, ContextModelShape, PerGroup, ShCoding, attributes::AttributeSteps,
    network_weights::WeightPrecision, planes::plan,
};

/// What a compressed stream keeps in full precision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Everything is quantised and entropy coded. Gaussians come back in another order.
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
    /// How finely the other attributes of the Gaussians are quantised, in the compact profile.
    pub attributes: AttributeSteps,
    /// How finely weights are quantised, in the compact profile.
    pub weights: WeightPrecisions,
}

/// How finely the weights of each kind of network are quantised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightPrecisions {
    /// Of the deformation network, whose errors show in the picture.
    pub deformation: WeightPrecision,
    /// Of the context model, whose errors only cost bits.
    pub context_model: WeightPrecision,
    /// Of the networks of the spherical harmonics, likewise.
    pub sh: WeightPrecision,
}

impl Default for WeightPrecisions {
    fn default() -> Self {
        let [deformation, context_model, sh] = [12, 8, 8].map(WeightPrecision::Bits);
        Self { deformation, context_model, sh }
    }
}

/// How the hexplane is coded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaneCoding {
    /// The networks that give distributions. They are used as the stream holds them, that is, quantised in the compact
    /// profile.
    pub model: ContextModelArrays,
    /// Quantisation steps, for all scales or one entry a scale.
    pub steps: Vec<PerGroup>,
    /// For each plane that has a hyperprior its symbols `[N, H/4, W/4]` row-major, an empty list for the others. Any
    /// integers within ±2^22 are legal; good ones are `round(h_a(P / step) - median)`.
    pub hyper_symbols: Vec<Vec<i32>>,
}

impl PlaneCoding {
    /// Channels, height and width of the hyperprior of each plane of a hexplane with these plane sizes `[height,
    /// width]`; nothing for planes that have none.
    ///
    /// This says where [`PlaneCoding::hyper_symbols`] must not be empty.
    pub fn hyper_shapes(model: &ContextModelShape, sizes: &[[u32; 2]]) -> Vec<Option<[u32; 3]>> {
        let plans = plan(model, sizes.len() / 6);
        let shape = |&[height, width]: &[u32; 2]| [model.hyper_channels, height / 4, width / 4];
        plans.iter().zip(sizes).map(|(plan, size)| plan.has_hyperprior().then(|| shape(size))).collect()
    }
}
