//! The multiscale hexplane context model, MHCM (paper III-C): a normal distribution for every value of every plane, and so
//! its bits in the file.
//!
//! | task | use |
//! |---|---|
//! | the paper's model | [`ContextModelConfig::compact`], or [`ContextModelConfig::reference`] for the sizes of the authors' code |
//! | an ablation | the same with fewer [`ContextPart`]s |
//! | bits in a loss, or of a finished scene | [`PlaneEntropy::rate`] |
//! | a part of your own | a [`PriorPart`], and a [`PlaneEntropy`] that holds it beside a [`ContextModel`] |
//! | the data for the codec | [`PlaneEntropy::to_arrays`], [`PlaneEntropy::latent_symbols`] |
//!
//! One set of weights serves all planes, from the lowest scale up. The part that applies to a plane:
//!
//! | plane | parameters | then |
//! |---|---|---|
//! | lowest scale, space-time | [`Hyperprior`] of the plane itself | [`Checkerboard`] |
//! | lowest scale, space-only | [`InterPlane`], from the decoded space-time planes | [`Checkerboard`] |
//! | higher scales | [`InterScale`], from the decoded plane one scale below | all at once |
//!
//! If a part is left out, or the planes that it reads do not exist, the next one that applies takes its place:
//! inter-scale, inter-plane, hyperprior, then a constant. [`EntropyParameters`] turns the output of a part into the distribution.
//!
//! The parts of the paper's model are listed in this file and nowhere else. A new one is a file of its own with a
//! [`PriorPart`], which computes its prior with Burn and describes the same network for the codec, and an entry in
//! [`PlaneEntropy::parts`]: of [`ContextModel`] here, where [`ContextPart`] gives it a name for configurations, or of a
//! composition of your own.

mod arrays;
pub(crate) mod checkerboard;
pub(crate) mod composition;
pub(crate) mod entropy_parameters;
pub(crate) mod hyperprior;
pub(crate) mod inter_plane;
pub(crate) mod inter_scale;
pub(crate) mod prior;
mod rate;

pub use checkerboard::{Checkerboard, CheckerboardConfig, anchor_mask};
pub use composition::PlaneEntropy;
pub use entropy_parameters::{EntropyParameters, EntropyParametersConfig, Start};
pub use hyperprior::{Hyperprior, HyperpriorConfig};
pub use inter_plane::{InterPlane, InterPlaneConfig};
pub use inter_scale::{HighScaleHyperprior, InterScale, InterScaleConfig, upsample};
pub use prior::{CenteredPlanes, DescribedCondition, DescribedPrior, Passes, Prior, PriorPart};
pub use rate::{PlaneRate, QuantizedPlane};

use burn::config::Config;
use burn::module::Module;
use burn::tensor::Device;
use light4gs_keys::Bounds::List;
use light4gs_keys::{choice, keys};

choice! {
    /// A part of a [`ContextModel`]. An ablation leaves some out.
    pub enum ContextPart: "part" {
        /// A latent, which is stored in the file, for the planes that are not predicted from other planes.
        Hyperprior = "hyperprior",
        /// Anchors are coded first, then the other positions with the anchors as context.
        Checkerboard = "checkerboard",
        /// Space-only planes are predicted from space-time planes.
        InterPlane = "inter_plane",
        /// Higher scales are predicted from the scale below.
        InterScale = "inter_scale",
        /// A latent for higher scales too, in addition to the inter-scale context, as in the reference.
        HighScaleHyperprior = "high_scale_hyperprior",
    }
}

impl ContextPart {
    /// Those of the paper's model.
    pub const PAPER: [Self; 4] = [Self::Hyperprior, Self::Checkerboard, Self::InterPlane, Self::InterScale];

    /// The parts that it needs: it consists of them or builds on them.
    pub fn needs(self) -> &'static [Self] {
        match self {
            Self::HighScaleHyperprior => &[Self::Hyperprior, Self::InterScale],
            _ => &[],
        }
    }

    /// The paper's parts without these.
    pub fn paper_without(absent: &[Self]) -> Vec<Self> {
        Self::PAPER.into_iter().filter(|part| !absent.contains(part)).collect()
    }
}

choice! {
    /// Sizes of the context model's networks.
    pub enum ContextArchitecture: "architecture" {
        /// Small networks, for small scenes: about 6000 weights at 16 channels.
        Compact = "compact",
        /// The public code's sizes.
        Reference = "reference",
    }
}

keys! {
    /// Parts and sizes of the context model.
    pub struct ContextConfig {
        /// Sizes of the context model's networks.
        architecture: ContextArchitecture = ContextArchitecture::Compact;
            ContextArchitecture::BOUNDS, "ours; reference";
        /// The parts of the context model; the default is the paper's four parts. The public code also has
        /// `"high_scale_hyperprior"`, which needs `"hyperprior"` and `"inter_scale"`. Without any part, every channel
        /// has one learned distribution.
        parts: Vec<ContextPart> = ContextPart::PAPER.to_vec();
            List { element: &ContextPart::BOUNDS, length: None }, "paper";
    }
}

impl ContextConfig {
    /// The model of planes with this number of channels.
    pub fn model(&self, channels: usize) -> ContextModelConfig {
        let sizes = match self.architecture {
            // The list of parts gives the composition; the reference's centers and start belong to its sizes.
            ContextArchitecture::Reference => ContextModelConfig::reference(channels),
            ContextArchitecture::Compact => ContextModelConfig::compact(channels),
        };
        sizes.with_parts(self.parts.clone())
    }
}

/// Kernel and groups of a convolution.
#[derive(Config, Debug, PartialEq)]
pub struct KernelShape {
    /// Side of the kernel, odd.
    pub kernel: usize,
    /// Groups of channels.
    pub groups: usize,
}

/// Configuration of a [`ContextModel`]. Start from one of the presets.
#[derive(Config, Debug)]
pub struct ContextModelConfig {
    /// Channels of a plane, M.
    pub channels: usize,
    /// Channels of the hyperprior's latent, N.
    pub latent_channels: usize,
    /// Channels between the layers of the hyperprior's synthesis, A and B.
    pub synthesis_channels: [usize; 2],
    /// Widths of the hidden layers of [`EntropyParameters`], C and D.
    pub parameter_channels: [usize; 2],
    /// Groups of the checkerboard's convolution.
    pub context_groups: usize,
    /// The inter-plane convolution.
    pub inter_plane: KernelShape,
    /// The inter-scale convolution.
    pub inter_scale: KernelShape,
    /// The parts of the model.
    #[config(default = "ContextPart::PAPER.to_vec()")]
    pub parts: Vec<ContextPart>,
    /// Subtracted from the space-only planes before anything else.
    #[config(default = 0.0)]
    pub space_only_center: f64,
    /// Subtracted from the space-time planes before anything else; they start at 1.
    #[config(default = 1.0)]
    pub space_time_center: f64,
    /// The initial values of the last layer.
    #[config(default = "Start::Unit")]
    pub start: Start,
}

impl ContextModelConfig {
    /// The sizes, centers, composition and initial values of the authors' code for planes of M channels.
    pub fn reference(channels: usize) -> Self {
        let kernel = KernelShape::new(5, 1);
        let hidden = [10 * channels / 3, 8 * channels / 3];
        let synthesis = [channels, 3 * channels / 2];
        Self::new(channels, (channels / 8).max(1), synthesis, hidden, 1, kernel.clone(), kernel)
            .with_parts([&ContextPart::PAPER[..], &[ContextPart::HighScaleHyperprior]].concat())
            .with_space_time_center(0.0)
            .with_start(Start::PyTorch)
    }

    /// Few weights, since they are part of the file: about 6000 in the decoder for 16 channels. Contexts treat each channel
    /// separately; only the 1×1 layers mix channels.
    pub fn compact(channels: usize) -> Self {
        let hidden = (3 * channels / 2).max(1);
        let inter_plane = KernelShape::new(3, 2 * channels);
        let inter_scale = KernelShape::new(3, channels);
        Self::new(channels, 4, [4, 4], [hidden, hidden], channels, inter_plane, inter_scale)
    }

    /// Random weights; see [`Start`] for the last layer.
    ///
    /// # Panics
    /// If a part is listed without those that it [needs](ContextPart::needs), or groups do not divide channels.
    pub fn init(&self, device: &Device) -> ContextModel {
        let has = |part| self.parts.contains(&part);
        for part in &self.parts {
            let missing = part.needs().iter().find(|needed| !has(**needed));
            assert!(missing.is_none(), "{part:?} needs {missing:?}");
        }
        let channels = self.channels;
        ContextModel {
            hyperprior: has(ContextPart::Hyperprior)
                .then(|| HyperpriorConfig::new(channels, self.latent_channels, self.synthesis_channels).init(device)),
            checkerboard: has(ContextPart::Checkerboard)
                .then(|| CheckerboardConfig::new(channels).with_groups(self.context_groups).init(device)),
            inter_plane: has(ContextPart::InterPlane).then(|| {
                let KernelShape { kernel, groups } = self.inter_plane;
                InterPlaneConfig::new(channels).with_kernel(kernel).with_groups(groups).init(device)
            }),
            inter_scale: has(ContextPart::InterScale).then(|| {
                let KernelShape { kernel, groups } = self.inter_scale;
                InterScaleConfig::new(channels).with_kernel(kernel).with_groups(groups).init(device)
            }),
            entropy_parameters: EntropyParametersConfig::new(channels, self.parameter_channels)
                .with_start(self.start.clone())
                .init(device),
            high_scale_hyperprior: has(ContextPart::HighScaleHyperprior),
            space_only_center: self.space_only_center,
            space_time_center: self.space_time_center,
        }
    }
}

/// The context model. See the [module's documentation](self) for its parts.
///
/// Planes are `[M, H, W]`, H and W multiples of 4, in original units; their
/// [`PlaneLayout`](light4gs_codec::plane_layout::PlaneLayout) lists them. In training they have uniform noise of their steps' width
/// ([`PlaneSteps::add_noise`](crate::PlaneSteps::add_noise)), and the parameters of a plane depend only on the noisy values of other planes. So a random
/// subset of planes gives an unbiased estimate of the rate.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_model::{ContextModelConfig, HexPlaneConfig, Latent, PlaneEntropy, PlaneSteps};
///
/// let device = Device::flex();
/// let hexplane = HexPlaneConfig { channels: 8, resolution: [8, 8, 8, 4], ..Default::default() }.init(&device);
/// let model = ContextModelConfig::compact(8).init(&device);
/// let steps = PlaneSteps::fixed(&[0.1; 12], &device);
/// let rates = model.rate(&steps.add_noise(&hexplane.tensors(), 7), &steps, &[2, 6], Latent::Noise);
/// // A space-time plane of the lowest scale has a hyperprior, a plane above has none.
/// assert!(rates[0].latent_bits.is_some() && rates[1].latent_bits.is_none());
/// ```
#[derive(Module, Debug)]
pub struct ContextModel {
    /// `h_a`, `h_s` and the latent's bottleneck.
    pub hyperprior: Option<Hyperprior>,
    /// `context_prediction`.
    pub checkerboard: Option<Checkerboard>,
    /// `inter_plane`.
    pub inter_plane: Option<InterPlane>,
    /// `inter_scale`.
    pub inter_scale: Option<InterScale>,
    /// `entropy_parameters`.
    pub entropy_parameters: EntropyParameters,
    high_scale_hyperprior: bool,
    space_only_center: f64,
    space_time_center: f64,
}

impl PlaneEntropy for ContextModel {
    fn base(&self) -> &ContextModel {
        self
    }

    fn base_mut(&mut self) -> &mut ContextModel {
        self
    }

    fn parts(&self) -> Vec<Box<dyn PriorPart + '_>> {
        let mut parts: Vec<Box<dyn PriorPart>> = Vec::new();
        match (&self.hyperprior, &self.inter_scale) {
            (Some(hyperprior), Some(inter_scale)) if self.high_scale_hyperprior => {
                parts.push(Box::new(HighScaleHyperprior { hyperprior, inter_scale }));
            }
            (_, Some(inter_scale)) => parts.push(Box::new(inter_scale)),
            _ => {}
        }
        if let Some(inter_plane) = &self.inter_plane {
            parts.push(Box::new(inter_plane));
        }
        if let Some(hyperprior) = &self.hyperprior {
            parts.push(Box::new(hyperprior));
        }
        parts
    }
}
