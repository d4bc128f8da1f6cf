//! The four entropy models of the spherical harmonics as one type: which there are stands here and nowhere else.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::ShPrior;

use super::autoregressive::{ShAutoregressive, ShAutoregressiveConfig};
use super::bottleneck::{ShBottleneck, ShBottleneckConfig};
use super::entropy::{ShEntropy, ShKnown, ShTables};
use super::hexplane_coupled::{ShHexPlaneCoupled, ShHexPlaneCoupledConfig};
use super::mixture::{ShMixture, ShMixtureConfig};
use crate::named_parameters::{Layer, NamedParameterVisitor, NamedParameters};

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

    fn priors(&self) -> Vec<ShPrior> {
        self.model().priors()
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
