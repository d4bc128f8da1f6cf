//! A mixture of logistics for each channel of the spherical harmonics (paper III-D, an alternative).

use std::ops::RangeInclusive;

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::entropy::{SH_CHANNELS, ShEntropy, ShKnown, ShTables, channels_first, channels_last};
use crate::entropy::gaussian_conditional::{LIKELIHOOD_BOUND, bits};
use crate::entropy::logistic_mixture::{LogisticMixture, LogisticMixtureConfig};
use crate::ops::lower_bound::lower_bound;

/// Configuration of a [`ShMixture`].
#[derive(Config, Debug)]
pub struct ShMixtureConfig {
    /// Distance between the values of neighboring symbols.
    #[config(default = 0.02)]
    pub step: f32,
    /// Logistics for each channel, K.
    #[config(default = 3)]
    pub components: usize,
    /// Initial scale of the narrowest logistic, in the units of the values; each other one is four times as wide as the
    /// one before.
    #[config(default = 0.02)]
    pub narrowest: f64,
}

impl ShMixtureConfig {
    /// Equal weights, means at zero, scales a factor of four apart: from values close to zero to those of a bright
    /// highlight.
    pub fn init(&self, device: &Device) -> ShMixture {
        let mixture = LogisticMixtureConfig::new(SH_CHANNELS)
            .with_components(self.components)
            .with_narrowest(self.narrowest)
            .init(device);
        ShMixture { mixture, step: self.step }
    }
}

/// `K` logistics for each of the 45 channels.
#[derive(Module, Debug)]
pub struct ShMixture {
    /// Over the values themselves, not over symbols.
    pub mixture: LogisticMixture,
    step: f32,
}

impl ShMixture {
    /// Probability of each of `values [N, 15, 3]`, at least [`LIKELIHOOD_BOUND`].
    pub fn likelihood(&self, values: Tensor<3>) -> Tensor<3> {
        channels_last(lower_bound(self.mass(values), LIKELIHOOD_BOUND))
    }

    /// Of each channel, without a bound.
    fn mass(&self, values: Tensor<3>) -> Tensor<2> {
        let widths = Tensor::full([SH_CHANNELS, 1], self.step, &values.device());
        self.mixture.interval_likelihood(channels_first(values), widths)
    }
}

impl ShEntropy for ShMixture {
    fn step(&self) -> f32 {
        self.step
    }

    fn bits(&self, values: Tensor<3>, _: &ShKnown) -> Tensor<3> {
        channels_last(bits(self.mass(values)))
    }

    fn tables(&self) -> Option<&dyn ShTables> {
        Some(self)
    }
}

impl ShTables for ShMixture {
    fn pmf(&self, symbols: RangeInclusive<i32>) -> Vec<Vec<f64>> {
        let (mixture, step) = (self.mixture.to_plain(), f64::from(self.step));
        let of_channel = |channel: usize| {
            let probability = |symbol: i32| {
                let edges = [-0.5, 0.5].map(|side| (f64::from(symbol) + side) * step);
                mixture.interval(channel, edges[0], edges[1])
            };
            symbols.clone().map(probability).collect()
        };
        (0..SH_CHANNELS).map(of_channel).collect()
    }
}
