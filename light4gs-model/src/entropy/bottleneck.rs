//! The factorized entropy bottleneck of the latents (Ballé et al. 2018, as in CompressAI; docs/design.md).

use std::ops::RangeInclusive;

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::{Device, Distribution, Tensor, s};

use super::factorized_density::{FactorizedDensity, FactorizedDensityConfig};
use super::gaussian_conditional::{LIKELIHOOD_BOUND, bits};
use crate::ops::lower_bound::lower_bound;

/// Probability outside of the outermost quantiles, both sides together.
const TAIL_MASS: f64 = 1e-9;

/// Which approximation of the decoded latent is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Latent {
    /// With uniform noise of a symbol's width in place of rounding: for training.
    Noise,
    /// Rounded around the channel's median, as it is coded. Without gradient to the latent.
    Rounded,
    /// The latent itself: for tests of the derivatives.
    Exact,
}

/// Configuration of an [`EntropyBottleneck`].
#[derive(Config, Debug)]
pub struct EntropyBottleneckConfig {
    /// Channels of the latent.
    pub channels: usize,
    /// The density is initially about this wide on either side of zero.
    #[config(default = 10.0)]
    pub initial_scale: f64,
}

impl EntropyBottleneckConfig {
    /// CompressAI's initial values; quantiles at minus and plus the initial scale, medians at 0.
    pub fn init(&self, device: &Device) -> EntropyBottleneck {
        let scale = self.initial_scale;
        let quantiles = Tensor::<1>::from_floats([-scale as f32, 0.0, scale as f32], device);
        EntropyBottleneck {
            density: FactorizedDensityConfig::new(self.channels).with_initial_scale(scale).init(device),
            quantiles: Param::from_tensor(quantiles.reshape([1, 1, 3]).repeat_dim(0, self.channels)),
        }
    }
}

/// A latent `[C, H, W]` coded channel by channel, each with a learned density.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::{EntropyBottleneckConfig, Latent};
///
/// let bottleneck = EntropyBottleneckConfig::new(4).init(&Device::flex());
/// let latent = Tensor::zeros([4, 8, 8], &Device::flex());
/// let (received, likelihood) = bottleneck.forward(latent, Latent::Rounded);
/// assert_eq!(received.dims(), [4, 8, 8]);
/// assert_eq!(likelihood.dims(), [4, 8, 8]);
/// ```
#[derive(Module, Debug)]
pub struct EntropyBottleneck {
    /// The channels' densities.
    pub density: FactorizedDensity,
    /// `[C, 1, 3]`: end of the lower tail, median, beginning of the upper tail.
    pub quantiles: Param<Tensor<3>>,
}

impl EntropyBottleneck {
    /// The decoded `latent [C, H, W]`, or its approximation, and the probability of each element; both `[C, H, W]`.
    pub fn forward(&self, latent: Tensor<3>, kind: Latent) -> (Tensor<3>, Tensor<3>) {
        let received = self.received(latent, kind);
        let likelihood = self.likelihood(received.clone());
        (received, likelihood)
    }

    /// The decoded `latent [C, H, W]`, or its approximation.
    pub fn received(&self, latent: Tensor<3>, kind: Latent) -> Tensor<3> {
        match kind {
            Latent::Exact => latent,
            Latent::Noise => {
                let noise = Tensor::random(latent.dims(), Distribution::Uniform(-0.5, 0.5), &latent.device());
                latent + noise
            }
            Latent::Rounded => self.symbols(latent) + self.medians(),
        }
    }

    /// Probability of the unit interval around each element of `[C, H, W]`, at least [`LIKELIHOOD_BOUND`].
    pub fn likelihood(&self, latent: Tensor<3>) -> Tensor<3> {
        lower_bound(self.mass(latent), LIKELIHOOD_BOUND)
    }

    /// Bits of the symbol of each element of `[C, H, W]`: those of [`Self::likelihood`], in one pass.
    pub fn bits(&self, latent: Tensor<3>) -> Tensor<3> {
        bits(self.mass(latent))
    }

    /// [`Self::likelihood`] without its bound.
    fn mass(&self, latent: Tensor<3>) -> Tensor<3> {
        let [channels, height, width] = latent.dims();
        let mass = self.density.interval_likelihood(latent.reshape([channels, height * width]), 1.0);
        mass.reshape([channels, height, width])
    }

    /// Integers `[C, H, W]`: the distance from the channel's median, rounded.
    pub fn symbols(&self, latent: Tensor<3>) -> Tensor<3> {
        (latent - self.medians()).detach().round()
    }

    /// `[C, 1, 1]`, without gradient.
    pub fn medians(&self) -> Tensor<3> {
        self.quantiles.val().set_require_grad(false).slice(s![.., .., 1..2])
    }

    /// Sets the quantiles to those of the densities. Call it before symbols are made: training changes the densities
    /// but not the quantiles.
    pub fn update_quantiles(&mut self) {
        let density = self.density.to_plain();
        let values: Vec<f32> = (0..density.channels())
            .flat_map(|channel| quantile_logits().map(|logit| density.quantile(channel, logit) as f32))
            .collect();
        let shape = self.quantiles.dims();
        let device = self.quantiles.val().device();
        self.quantiles = Param::from_tensor(Tensor::<1>::from_floats(values.as_slice(), &device).reshape(shape));
    }

    /// `[1]`: the distance of the distribution functions at the quantiles from their target values. Its gradient changes only
    /// the quantiles. For programs that train them, as CompressAI does; [`Self::update_quantiles`] computes them directly.
    pub fn auxiliary_loss(&self) -> Tensor<1> {
        let channels = self.density.channels();
        let logits = self.density.logits_of_frozen(self.quantiles.val().reshape([channels, 3]));
        let targets = quantile_logits().map(|logit| logit as f32);
        let targets = Tensor::<1>::from_floats(targets, &logits.device()).unsqueeze::<2>();
        (logits - targets).abs().sum()
    }

    /// Symbols from the lower to the upper quantile, a range for each channel.
    pub fn symbol_ranges(&self) -> Vec<RangeInclusive<i32>> {
        let quantiles: Vec<f32> = self.quantiles.val().into_data().iter::<f32>().collect();
        let ranges = quantiles.as_chunks::<3>().0.iter().map(|[low, median, high]| {
            let below = (median - low).ceil().max(0.0) as i32;
            let above = (high - median).ceil().max(0.0) as i32;
            -below..=above
        });
        ranges.collect()
    }

    /// Probabilities of these symbols for each channel, in float64 on the host, from which frequency tables are made.
    pub fn pmf(&self, symbols: RangeInclusive<i32>) -> Vec<Vec<f64>> {
        let density = self.density.to_plain();
        let medians: Vec<f64> = self.medians().into_data().iter::<f64>().collect();
        let channels = medians.iter().enumerate().map(|(channel, median)| {
            let probability = |symbol: i32| {
                let value = f64::from(symbol) + median;
                density.interval(channel, value - 0.5, value + 0.5)
            };
            symbols.clone().map(probability).collect()
        });
        channels.collect()
    }
}

/// Logits of the distribution function at the three quantiles.
fn quantile_logits() -> [f64; 3] {
    let outer = (2.0 / TAIL_MASS - 1.0).ln();
    [-outer, 0.0, outer]
}
