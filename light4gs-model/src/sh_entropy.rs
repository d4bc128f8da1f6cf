//! Entropy models of the higher spherical harmonics (paper III-D; DESIGN section 6): four of them, one interface.
//!
//! | model | a value's density comes from | travels as |
//! |---|---|---|
//! | [`ShBottleneck`] | its channel: a learned monotone network | integer tables |
//! | [`ShMixture`] | its channel: a few logistics | integer tables |
//! | [`ShAutoregressive`] | the colour and the lower degrees of the same Gaussian | layers |
//! | [`ShHexPlaneCoupled`] | the space-only planes at the Gaussian's position | layers |
//!
//! A channel is `coefficient * 3 + rgb` of `sh_rest [N, 15, 3]`; there are 45.

use std::ops::RangeInclusive;

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};

use crate::gaussian_conditional::{bits, gaussian_likelihood};
use crate::named_parameters::{Layer, NamedParameterVisitor, NamedParameters};
use crate::sh_autoregressive::{ShAutoregressive, ShAutoregressiveConfig};
use crate::sh_bottleneck::{ShBottleneck, ShBottleneckConfig};
use crate::sh_hexplane_coupled::{ShHexPlaneCoupled, ShHexPlaneCoupledConfig};
use crate::sh_mixture::{ShMixture, ShMixtureConfig};

/// Channels of the higher spherical harmonics.
pub const SH_CHANNELS: usize = 45;

/// What a decoder knows of the Gaussians before it decodes their spherical harmonics.
#[derive(Clone, Debug)]
pub struct ShKnown {
    /// Degree-0 spherical harmonics, `[N, 1, 3]`.
    pub sh_dc: Tensor<3>,
    /// Positions in the scene's frame, `[N, 3]` in [-1, 1].
    pub positions: Tensor<2>,
    /// All planes of the hexplane `[M, H, W]`, scale-major.
    pub planes: Vec<Tensor<3>>,
}

impl ShKnown {
    /// For models whose densities depend on nothing (see [`ShTables`]): no Gaussian, no plane.
    pub fn nothing(device: &Device) -> Self {
        Self { sh_dc: Tensor::zeros([0, 1, 3], device), positions: Tensor::zeros([0, 3], device), planes: Vec::new() }
    }
}

/// An entropy model of `sh_rest`.
pub trait ShEntropy {
    /// Distance between the values of neighbouring symbols.
    fn step(&self) -> f32;

    /// Bits of each value, `[N, 15, 3]`, of `values [N, 15, 3]`: noisy in training, quantised in an evaluation.
    /// Differentiable in the values, in what is known and in the weights.
    fn bits(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3>;

    /// Values with uniform noise of the step's width, which stands for rounding in training.
    fn add_noise(&self, values: Tensor<3>) -> Tensor<3> {
        let half = f64::from(self.step()) / 2.0;
        let noise = Tensor::random(values.dims(), Distribution::Uniform(-half, half), &values.device());
        values + noise
    }

    /// `values` as a decoder gets them. Without gradient.
    fn quantize(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3>;
}

/// An entropy model whose densities do not depend on anything: a frequency table for each channel.
pub trait ShTables {
    /// For each of the 45 channels the probabilities of these symbols (`value / step`), in float64 on the host.
    fn pmf(&self, symbols: RangeInclusive<i32>) -> Vec<Vec<f64>>;
}

/// Which entropy model, with its configuration.
#[derive(Config, Debug)]
pub enum ShEntropyConfig {
    /// The paper's choice.
    Factorized(ShBottleneckConfig),
    /// A mixture of logistics for each channel.
    Mixture(ShMixtureConfig),
    /// Degree by degree.
    Autoregressive(ShAutoregressiveConfig),
    /// From the space-only planes.
    HexPlaneCoupled(ShHexPlaneCoupledConfig),
}

impl ShEntropyConfig {
    /// The configured model with its initial weights.
    pub fn init(&self, device: &Device) -> ShEntropyModel {
        match self {
            Self::Factorized(config) => ShEntropyModel::Factorized(config.init(device)),
            Self::Mixture(config) => ShEntropyModel::Mixture(config.init(device)),
            Self::Autoregressive(config) => ShEntropyModel::Autoregressive(config.init(device)),
            Self::HexPlaneCoupled(config) => ShEntropyModel::HexPlaneCoupled(config.init(device)),
        }
    }
}

/// One of the four models.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::{ShBottleneckConfig, ShEntropy, ShEntropyConfig, ShKnown};
///
/// let device = Device::flex();
/// let model = ShEntropyConfig::Factorized(ShBottleneckConfig::new()).init(&device);
/// let known = ShKnown {
///     sh_dc: Tensor::zeros([7, 1, 3], &device),
///     positions: Tensor::zeros([7, 3], &device),
///     planes: Vec::new(),
/// };
/// let noisy = model.add_noise(Tensor::zeros([7, 15, 3], &device));
/// assert_eq!(model.bits(noisy, &known).dims(), [7, 15, 3]);
/// ```
// There is one of it in a scene, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Module, Debug)]
pub enum ShEntropyModel {
    /// The paper's choice.
    Factorized(ShBottleneck),
    /// A mixture of logistics for each channel.
    Mixture(ShMixture),
    /// Degree by degree.
    Autoregressive(ShAutoregressive),
    /// From the space-only planes.
    HexPlaneCoupled(ShHexPlaneCoupled),
}

impl ShEntropyModel {
    fn model(&self) -> &dyn ShEntropy {
        match self {
            Self::Factorized(model) => model,
            Self::Mixture(model) => model,
            Self::Autoregressive(model) => model,
            Self::HexPlaneCoupled(model) => model,
        }
    }

    /// The model's frequency tables, if it travels as such.
    pub fn tables(&self) -> Option<&dyn ShTables> {
        match self {
            Self::Factorized(model) => Some(model),
            Self::Mixture(model) => Some(model),
            Self::Autoregressive(_) | Self::HexPlaneCoupled(_) => None,
        }
    }

    /// The model's layers as the stream stores them; none if it travels as tables.
    pub fn layers(&self) -> Vec<Layer<'_>> {
        match self {
            Self::Factorized(_) | Self::Mixture(_) => Vec::new(),
            Self::Autoregressive(model) => model.layers(),
            Self::HexPlaneCoupled(model) => model.layers(),
        }
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
}

impl NamedParameters for ShEntropyModel {
    fn visit_parameters(&mut self, visitor: &mut impl NamedParameterVisitor) {
        match self {
            Self::Factorized(model) => model.visit_parameters(visitor),
            Self::Mixture(model) => model.visit_parameters(visitor),
            Self::Autoregressive(model) => model.visit_parameters(visitor),
            Self::HexPlaneCoupled(model) => model.visit_parameters(visitor),
        }
    }
}

/// `[45, N]` from `[N, 15, 3]`.
pub(crate) fn channels_first(values: Tensor<3>) -> Tensor<2> {
    let count = values.dims()[0];
    values.reshape([count, SH_CHANNELS]).transpose()
}

/// `[N, 15, 3]` from `[45, N]`.
pub(crate) fn channels_last(values: Tensor<2>) -> Tensor<3> {
    let count = values.dims()[1];
    values.transpose().reshape([count, SH_CHANNELS / 3, 3])
}

/// Bits `[C, N]` of `values [C, N]`, given the output `[2 C, 1, N]` of a network: first scales, then means, in steps.
pub(crate) fn gaussian_bits(values: Tensor<2>, output: Tensor<3>, step: f32) -> Tensor<2> {
    let [scales, means] = scales_and_means(output);
    bits(gaussian_likelihood(values / step, means, scales))
}

/// `values [C, N]` rounded around the means of a network's output `[2 C, 1, N]`.
pub(crate) fn round_around(values: Tensor<2>, output: Tensor<3>, step: f32) -> Tensor<2> {
    let [_, means] = scales_and_means(output);
    ((values / step - means.clone()).round() + means) * step
}

fn scales_and_means(output: Tensor<3>) -> [Tensor<2>; 2] {
    let output: Tensor<2> = output.squeeze_dim(1);
    let channels = output.dims()[0] / 2;
    [output.clone().narrow(0, 0, channels), output.narrow(0, channels, channels)]
}
