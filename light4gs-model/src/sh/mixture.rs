//! A mixture of logistics for each channel of the spherical harmonics (paper III-D, an alternative).

use std::ops::RangeInclusive;

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor};

use super::entropy::{SH_CHANNELS, ShEntropy, ShKnown, ShTables, channels_first, channels_last};
use crate::entropy::factorized_density::{logistic_interval, plain_logistic_interval};
use crate::entropy::gaussian_conditional::{LIKELIHOOD_BOUND, bits};
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
        let shape = [SH_CHANNELS, self.components];
        let log_scales: Vec<f32> =
            (0..self.components).map(|k| (self.narrowest * 4f64.powi(k as i32)).ln() as f32).collect();
        let log_scales = Tensor::<1>::from_floats(log_scales.as_slice(), device).unsqueeze::<2>();
        ShMixture {
            weight_logits: Param::from_tensor(Tensor::zeros(shape, device)),
            means: Param::from_tensor(Tensor::zeros(shape, device)),
            log_scales: Param::from_tensor(log_scales.repeat_dim(0, SH_CHANNELS)),
            step: self.step,
        }
    }
}

/// `K` logistics for each of the 45 channels, over the values themselves.
#[derive(Module, Debug)]
pub struct ShMixture {
    /// `[45, K]`, through softmax.
    pub weight_logits: Param<Tensor<2>>,
    /// `[45, K]`.
    pub means: Param<Tensor<2>>,
    /// `[45, K]`.
    pub log_scales: Param<Tensor<2>>,
    step: f32,
}

impl ShMixture {
    /// Probability of each of `values [N, 15, 3]`, at least [`LIKELIHOOD_BOUND`].
    pub fn likelihood(&self, values: Tensor<3>) -> Tensor<3> {
        // [45, K, N].
        let distance = channels_first(values).unsqueeze_dim::<3>(1) - self.means.val().unsqueeze_dim::<3>(2);
        let inverse = self.log_scales.val().neg().exp().unsqueeze_dim::<3>(2);
        let half = self.step / 2.0;
        let lower = (distance.clone() - half) * inverse.clone();
        let upper = (distance + half) * inverse;
        let weights = softmax(self.weight_logits.val(), 1).unsqueeze_dim::<3>(2);
        let likelihood = (logistic_interval(lower, upper) * weights).sum_dim(1).squeeze_dim(1);
        channels_last(lower_bound(likelihood, LIKELIHOOD_BOUND))
    }
}

impl ShEntropy for ShMixture {
    fn step(&self) -> f32 {
        self.step
    }

    fn bits(&self, values: Tensor<3>, _: &ShKnown) -> Tensor<3> {
        bits(self.likelihood(values))
    }

    fn tables(&self) -> Option<&dyn ShTables> {
        Some(self)
    }
}

impl ShTables for ShMixture {
    fn pmf(&self, symbols: RangeInclusive<i32>) -> Vec<Vec<f64>> {
        let components = self.means.dims()[1];
        let host = |parameter: &Param<Tensor<2>>| parameter.val().into_data().iter::<f64>().collect::<Vec<_>>();
        let (logits, means, log_scales) = (host(&self.weight_logits), host(&self.means), host(&self.log_scales));
        let step = f64::from(self.step);
        let of_channel = |channel: usize| {
            let own = channel * components..(channel + 1) * components;
            let total: f64 = logits[own.clone()].iter().map(|logit| logit.exp()).sum();
            let probability = |symbol: i32| {
                let component = |k: usize| {
                    let edge = |side: f64| ((f64::from(symbol) + side) * step - means[k]) / log_scales[k].exp();
                    logits[k].exp() / total * plain_logistic_interval(edge(-0.5), edge(0.5))
                };
                own.clone().map(component).sum()
            };
            symbols.clone().map(probability).collect()
        };
        (0..SH_CHANNELS).map(of_channel).collect()
    }
}
