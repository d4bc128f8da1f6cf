//! Entropy model of the spherical harmonics that uses the feature planes (paper III-D, an alternative).

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::{Network, ShPrior, ShSource};

use super::entropy::{SH_CHANNELS, ShEntropy, ShKnown, channels_first, channels_last, gaussian_bits, round_around};
use super::network::ShNetwork;

/// Configuration of a [`ShHexPlaneCoupled`].
#[derive(Config, Debug)]
pub struct ShHexPlaneCoupledConfig {
    /// Channels of a plane times scales: the length of a feature.
    pub feature_size: usize,
    /// Distance between the values of neighboring symbols.
    #[config(default = 0.02)]
    pub step: f32,
    /// Width of the hidden layer.
    #[config(default = 32)]
    pub hidden: usize,
    /// Initial standard deviations, in steps.
    #[config(default = 4.0)]
    pub initial_scale: f32,
}

impl ShHexPlaneCoupledConfig {
    /// Random weights; the last layer starts at the initial scale and mean 0.
    pub fn init(&self, device: &Device) -> ShHexPlaneCoupled {
        let network = ShNetwork::new(self.feature_size, self.hidden, SH_CHANNELS, self.initial_scale, device);
        ShHexPlaneCoupled { network, step: self.step }
    }
}

/// A network from the space-only planes' feature at a Gaussian's position to the distributions of its channels.
#[derive(Module, Debug)]
pub struct ShHexPlaneCoupled {
    /// `sh_hex`.
    pub network: ShNetwork,
    step: f32,
}

impl ShHexPlaneCoupled {
    /// Scales and means `[90, 1, N]`.
    fn output(&self, known: &ShKnown) -> Tensor<3> {
        self.network.forward(known.planes.query_space(known.positions.clone()).transpose().unsqueeze_dim(1))
    }
}

impl ShEntropy for ShHexPlaneCoupled {
    fn step(&self) -> f32 {
        self.step
    }

    fn bits(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        channels_last(gaussian_bits(channels_first(values), self.output(known), self.step))
    }

    fn quantize(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        channels_last(round_around(channels_first(values.detach()), self.output(known).detach(), self.step))
    }

    fn priors(&self) -> Vec<ShPrior> {
        let [first, _] = &self.network.layers;
        let (mut network, [features]) = Network::new([first.to_layer().inputs]);
        let output = self.network.describe(&mut network, features);
        network.output(output);
        vec![ShPrior { network, sources: vec![ShSource::SpaceFeatures] }]
    }
}
