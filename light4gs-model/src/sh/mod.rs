//! Entropy models of the higher spherical harmonics (paper III-D; docs/design.md): one interface, several of them.
//!
//! | model | a value's density depends on | in the file |
//! |---|---|---|
//! | [`ShBottleneck`] | its channel: a learned monotone network | integer tables |
//! | [`ShMixture`] | its channel: a few logistics | integer tables |
//! | [`ShAutoregressive`] | the color and the lower degrees of the same Gaussian | layers |
//! | [`ShHexPlaneCoupled`] | the space-only planes at the Gaussian's position | layers |
//!
//! The first is the paper's choice and the default. Scenes in the `compact` profile use the first two in training only,
//! since the codec predicts harmonics from neighbors instead. [`ShConfig`] chooses a model by name; a model of your own
//! implements [`ShEntropy`]. Without any model, [`counted_sh_coding`] makes tables from frequencies.
//!
//! The models are listed in this file and nowhere else: a new one is a file of its own and a row in the list here.
//!
//! A channel is `coefficient * 3 + rgb` of `sh_rest [N, 15, 3]`; there are 45.

pub(crate) mod autoregressive;
pub(crate) mod bottleneck;
pub(crate) mod entropy;
pub(crate) mod hexplane_coupled;
pub(crate) mod mixture;
pub(crate) mod network;
mod tables;

pub use autoregressive::{ShAutoregressive, ShAutoregressiveConfig};
pub use bottleneck::{ShBottleneck, ShBottleneckConfig};
pub use entropy::{
    SH_CHANNELS, ShEntropy, ShKnown, ShTables, channels_first, channels_last, gaussian_bits, round_around,
};
pub use hexplane_coupled::{ShHexPlaneCoupled, ShHexPlaneCoupledConfig};
pub use mixture::{ShMixture, ShMixtureConfig};
pub use network::ShNetwork;
pub use tables::counted_sh_coding;

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::ShPrior;
use light4gs_keys::{choice, keys};

use crate::entropy::QUANTIZATION_STEP;

/// Width of the factorized densities before training, in the units of the values. The reference begins at 8, and in its log
/// the rate needs hundreds of iterations to come down from there; our runs are shorter.
const SH_INITIAL_SCALE: f64 = 0.3;

/// From a list of models, declares their names, the configuration of each, and one type that can hold any of them.
macro_rules! built_in_models {
    ($(
        $(#[doc = $about:literal])+
        $variant:ident = $name:literal: $model:ident, $config:ident: |$step:pat_param, $features:pat_param| $usual:expr;
    )+) => {
        choice! {
            /// The built-in models.
            pub enum ShKind: "model" {
                $($(#[doc = $about])+ $variant = $name,)+
            }
        }

        impl ShConfig {
            /// The chosen model, for planes with features of this length (0 without planes).
            pub fn model(&self, feature_size: usize) -> ShEntropyConfig {
                match self.model {
                    $(ShKind::$variant => {
                        let ($step, $features) = (self.step as f32, feature_size);
                        ShEntropyConfig::$variant($usual)
                    })+
                }
            }
        }

        /// The choice of an entropy model, with its configuration.
        #[derive(Config, Debug)]
        pub enum ShEntropyConfig {
            $($(#[doc = $about])+ $variant($config),)+
        }

        impl ShEntropyConfig {
            /// The configured model with its initial weights.
            pub fn init(&self, device: &Device) -> ShEntropyModel {
                match self {
                    $(Self::$variant(config) => ShEntropyModel::$variant(config.init(device)),)+
                }
            }
        }

        /// One of the built-in models.
        ///
        /// ```
        /// use burn::tensor::{Device, Tensor};
        /// use light4gs_model::{PlaneTensors, ShBottleneckConfig, ShEntropy, ShEntropyConfig, ShKnown};
        ///
        /// let device = Device::flex();
        /// let model = ShEntropyConfig::Factorized(ShBottleneckConfig::new()).init(&device);
        /// let known = ShKnown {
        ///     sh_dc: Tensor::zeros([7, 1, 3], &device),
        ///     positions: Tensor::zeros([7, 3], &device),
        ///     planes: PlaneTensors::default(),
        /// };
        /// let noisy = model.add_noise(Tensor::zeros([7, 15, 3], &device));
        /// assert_eq!(model.bits(noisy, &known).dims(), [7, 15, 3]);
        /// ```
        // There is one of it in a scene, so its size does not matter.
        #[allow(clippy::large_enum_variant)]
        #[derive(Module, Debug)]
        pub enum ShEntropyModel {
            $($(#[doc = $about])+ $variant($model),)+
        }

        impl ShEntropyModel {
            fn model(&self) -> &dyn ShEntropy {
                match self {
                    $(Self::$variant(model) => model,)+
                }
            }
        }
    };
}

built_in_models! {
    /// One learned density for each channel, as in the paper.
    Factorized = "factorized": ShBottleneck, ShBottleneckConfig:
        |step, _| ShBottleneckConfig::new().with_step(step).with_initial_scale(SH_INITIAL_SCALE);
    /// A mixture of logistics for each channel.
    Mixture = "mixture_of_logistics": ShMixture, ShMixtureConfig: |step, _| ShMixtureConfig::new().with_step(step);
    /// Every degree is predicted from those below it.
    Autoregressive = "channel_autoregressive": ShAutoregressive, ShAutoregressiveConfig:
        |step, _| ShAutoregressiveConfig::new().with_step(step);
    /// The parameters of the distributions follow from the space-only planes at the Gaussian's position.
    HexPlaneCoupled = "hexplane_coupled": ShHexPlaneCoupled, ShHexPlaneCoupledConfig:
        |step, feature_size| ShHexPlaneCoupledConfig::new(feature_size).with_step(step);
}

impl ShKind {
    /// Whether it reads the planes of the deformation field.
    pub fn needs_planes(self) -> bool {
        self == Self::HexPlaneCoupled
    }
}

keys! {
    /// The model of the spherical harmonics beyond degree 0.
    pub struct ShConfig {
        /// Entropy model of the spherical harmonics beyond degree 0. Only scenes of degree 3 have such a model. The
        /// densities of `"factorized"` and `"mixture_of_logistics"` are the same for all Gaussians. In the `compact`
        /// profile the file does not use these two models, because prediction from neighboring Gaussians saves more.
        model: ShKind = ShKind::Factorized; ShKind::BOUNDS, "paper";
        /// Quantization step of the spherical harmonics beyond degree 0.
        step: f64 = 0.02; QUANTIZATION_STEP, "paper";
    }
}

impl ShEntropy for ShEntropyModel {
    fn step(&self) -> f32 {
        self.model().step()
    }

    fn bits(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        self.model().bits(values, known)
    }

    fn quantize(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        self.model().quantize(values, known)
    }

    fn tables(&self) -> Option<&dyn ShTables> {
        self.model().tables()
    }

    fn priors(&self) -> Vec<ShPrior> {
        self.model().priors()
    }
}
