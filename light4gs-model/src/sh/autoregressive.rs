//! Channel-wise autoregressive entropy model of the spherical harmonics: degree by degree (paper III-D, an alternative).

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network::Operation;
use light4gs_codec::{Network, ShPrior, ShSource};

use super::entropy::{ShEntropy, ShKnown, channels_first, channels_last, gaussian_bits, round_around};
use super::network::ShNetwork;

/// First channel and number of channels of the degrees 1, 2 and 3.
const DEGREES: [(usize, usize); 3] = [(0, 9), (9, 15), (24, 21)];
const DC: usize = 3;

/// Configuration of a [`ShAutoregressive`].
#[derive(Config, Debug)]
pub struct ShAutoregressiveConfig {
    /// Distance between the values of neighboring symbols.
    #[config(default = 0.02)]
    pub step: f32,
    /// Width of the hidden layers.
    #[config(default = 32)]
    pub hidden: usize,
    /// Initial standard deviations, in steps.
    #[config(default = 4.0)]
    pub initial_scale: f32,
}

impl ShAutoregressiveConfig {
    /// Random weights; the last layers start at the initial scale and mean 0.
    pub fn init(&self, device: &Device) -> ShAutoregressive {
        let network = |(known, channels)| ShNetwork::new(DC + known, self.hidden, channels, self.initial_scale, device);
        ShAutoregressive { degrees: DEGREES.map(network), step: self.step }
    }
}

/// A network for each degree: from the color and all lower degrees of a Gaussian to the distributions of the degree's
/// channels.
#[derive(Module, Debug)]
pub struct ShAutoregressive {
    /// `sh_ar.{degree - 1}`.
    pub degrees: [ShNetwork; 3],
    step: f32,
}

impl ShAutoregressive {
    /// Scales and means `[2 C, 1, N]` of a degree's channels, from `dc [3, N]` and the lower degrees in `values [45, N]`.
    fn output(&self, degree: usize, dc: &Tensor<2>, values: &Tensor<2>) -> Tensor<3> {
        let (lower, _) = DEGREES[degree];
        let features = match lower {
            0 => dc.clone(),
            _ => Tensor::cat(vec![dc.clone(), values.clone().narrow(0, 0, lower)], 0),
        };
        self.degrees[degree].forward(features.unsqueeze_dim(1))
    }
}

fn dc_of(known: &ShKnown) -> Tensor<2> {
    known.sh_dc.clone().squeeze_dim::<2>(1).transpose()
}

impl ShEntropy for ShAutoregressive {
    fn step(&self) -> f32 {
        self.step
    }

    fn bits(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        let (dc, values) = (dc_of(known), channels_first(values));
        let degrees = DEGREES.iter().enumerate().map(|(degree, (start, channels))| {
            let own = values.clone().narrow(0, *start, *channels);
            gaussian_bits(own, self.output(degree, &dc, &values), self.step)
        });
        channels_last(Tensor::cat(degrees.collect(), 0))
    }

    fn quantize(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        let (dc, values) = (dc_of(known), channels_first(values.detach()));
        let mut decoded: Vec<Tensor<2>> = Vec::new();
        for (degree, (start, channels)) in DEGREES.into_iter().enumerate() {
            // A network reads only channels before its own.
            let lower = if degree == 0 { values.clone() } else { Tensor::cat(decoded.clone(), 0) };
            let own = values.clone().narrow(0, start, channels);
            decoded.push(round_around(own, self.output(degree, &dc, &lower).detach(), self.step));
        }
        channels_last(Tensor::cat(decoded, 0))
    }

    fn priors(&self) -> Vec<ShPrior> {
        let prior = |(degree, (lower, _)): (&ShNetwork, (usize, usize))| {
            let (mut network, sources, features);
            if lower == 0 {
                (network, [features]) = Network::new([DC as u32]);
                sources = vec![ShSource::Dc];
            } else {
                let inputs;
                (network, inputs) = Network::new([DC as u32, lower as u32]);
                features = network.node(Operation::Concatenate, &inputs);
                sources = vec![ShSource::Dc, ShSource::Decoded];
            }
            let output = degree.describe(&mut network, features);
            network.output(output);
            ShPrior { network, sources }
        };
        self.degrees.iter().zip(DEGREES).map(prior).collect()
    }
}
