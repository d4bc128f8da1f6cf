//! The factorized entropy model of the spherical harmonics: a learned density for each channel (paper III-D).

use std::ops::RangeInclusive;

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::entropy::{SH_CHANNELS, ShEntropy, ShKnown, ShTables, channels_first, channels_last};
use crate::entropy::factorized_density::{FactorizedDensity, FactorizedDensityConfig};
use crate::entropy::gaussian_conditional::LIKELIHOOD_BOUND;
use crate::ops::symbol_bits::{BelowBound, symbol_bits};

/// Configuration of a [`ShBottleneck`].
#[derive(Config, Debug)]
pub struct ShBottleneckConfig {
    /// Distance between the values of neighboring symbols.
    #[config(default = 0.02)]
    pub step: f32,
    /// The density is initially about this wide on either side of zero, in the units of the values.
    #[config(default = 8.0)]
    pub initial_scale: f64,
}

impl ShBottleneckConfig {
    /// Three hidden layers of width 3; biases random, everything else fixed.
    pub fn init(&self, device: &Device) -> ShBottleneck {
        let density = FactorizedDensityConfig::new(SH_CHANNELS)
            .with_filters(vec![3, 3, 3])
            .with_initial_scale(self.initial_scale)
            .with_bend_last_layer(true);
        ShBottleneck { density: density.init(device), step: self.step }
    }
}

/// A density for each of the 45 channels.
#[derive(Module, Debug)]
pub struct ShBottleneck {
    /// Over the values themselves, not over symbols.
    pub density: FactorizedDensity,
    step: f32,
}

impl ShBottleneck {
    /// Probability of each of `values [N, 15, 3]`, at least [`LIKELIHOOD_BOUND`]; no gradient comes from below that.
    pub fn likelihood(&self, values: Tensor<3>) -> Tensor<3> {
        channels_last(self.mass(values).clamp_min(LIKELIHOOD_BOUND))
    }

    /// Of each channel, without a bound.
    fn mass(&self, values: Tensor<3>) -> Tensor<2> {
        self.density.interval_likelihood(channels_first(values), self.step)
    }
}

impl ShEntropy for ShBottleneck {
    fn step(&self) -> f32 {
        self.step
    }

    fn bits(&self, values: Tensor<3>, _: &ShKnown) -> Tensor<3> {
        channels_last(symbol_bits(self.mass(values), LIKELIHOOD_BOUND, BelowBound::Stays))
    }

    fn tables(&self) -> Option<&dyn ShTables> {
        Some(self)
    }
}

impl ShTables for ShBottleneck {
    fn pmf(&self, symbols: RangeInclusive<i32>) -> Vec<Vec<f64>> {
        let (density, step) = (self.density.to_plain(), f64::from(self.step));
        let of_channel = |channel: usize| {
            let probability = |symbol: i32| {
                let edges = [-0.5, 0.5].map(|side| (f64::from(symbol) + side) * step);
                density.interval(channel, edges[0], edges[1])
            };
            symbols.clone().map(probability).collect()
        };
        (0..density.channels()).map(of_channel).collect()
    }
}
