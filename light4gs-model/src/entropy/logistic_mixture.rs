//! A mixture of logistics for each channel: a density with few parameters, whose mass in an interval takes few
//! operations.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor};

use super::factorized_density::{logistic_interval, plain_logistic_interval};

/// Configuration of a [`LogisticMixture`].
#[derive(Config, Debug)]
pub struct LogisticMixtureConfig {
    /// Channels, each with its own density.
    pub channels: usize,
    /// Logistics for each channel, K.
    #[config(default = 3)]
    pub components: usize,
    /// Initial scale of the narrowest logistic, in the units of the values.
    #[config(default = 0.02)]
    pub narrowest: f64,
    /// Initial scale of each further logistic, divided by that of the one before.
    #[config(default = 4.0)]
    pub ratio: f64,
}

impl LogisticMixtureConfig {
    /// Equal weights, means at zero.
    pub fn init(&self, device: &Device) -> LogisticMixture {
        let shape = [self.channels, self.components];
        let log_scale = |k| (self.narrowest * self.ratio.powi(k as i32)).ln() as f32;
        let log_scales: Vec<f32> = (0..self.components).map(log_scale).collect();
        let log_scales = Tensor::<1>::from_floats(log_scales.as_slice(), device).unsqueeze::<2>();
        LogisticMixture {
            weight_logits: Param::from_tensor(Tensor::zeros(shape, device)),
            means: Param::from_tensor(Tensor::zeros(shape, device)),
            log_scales: Param::from_tensor(log_scales.repeat_dim(0, self.channels)),
        }
    }
}

/// Densities of `C` channels, each a mixture of `K` logistics.
#[derive(Module, Debug)]
pub struct LogisticMixture {
    /// `[C, K]`, through softmax.
    pub weight_logits: Param<Tensor<2>>,
    /// `[C, K]`, in the units of the values.
    pub means: Param<Tensor<2>>,
    /// `[C, K]`, natural logarithms.
    pub log_scales: Param<Tensor<2>>,
}

impl LogisticMixture {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.means.dims()[0]
    }

    /// Probability of the interval around each of `x [C, N]`, without a lower bound: `[C, N]`. `widths [C, 1]` are
    /// those of the channels' intervals.
    pub fn interval_likelihood(&self, x: Tensor<2>, widths: Tensor<2>) -> Tensor<2> {
        // [C, K, N].
        let distance = x.unsqueeze_dim::<3>(1) - self.means.val().unsqueeze_dim::<3>(2);
        let inverse = self.log_scales.val().neg().exp().unsqueeze_dim::<3>(2);
        let half = (widths / 2.0).unsqueeze_dim::<3>(2);
        let lower = (distance.clone() - half.clone()) * inverse.clone();
        let upper = (distance + half) * inverse;
        let weights = softmax(self.weight_logits.val(), 1).unsqueeze_dim::<3>(2);
        (logistic_interval(lower, upper) * weights).sum_dim(1).squeeze_dim(1)
    }

    /// The same densities in float64 on the host.
    pub fn to_plain(&self) -> PlainMixture {
        let host = |parameter: &Param<Tensor<2>>| parameter.val().into_data().iter::<f64>().collect::<Vec<_>>();
        PlainMixture {
            weight_logits: host(&self.weight_logits),
            means: host(&self.means),
            log_scales: host(&self.log_scales),
            components: self.means.dims()[1],
        }
    }
}

/// A [`LogisticMixture`] in float64, without a back end, from which integer frequency tables are made.
#[derive(Clone, Debug)]
pub struct PlainMixture {
    weight_logits: Vec<f64>,
    means: Vec<f64>,
    log_scales: Vec<f64>,
    components: usize,
}

impl PlainMixture {
    /// Probability of a channel's interval from `low` to `high`.
    pub fn interval(&self, channel: usize, low: f64, high: f64) -> f64 {
        let own = channel * self.components..(channel + 1) * self.components;
        let total: f64 = self.weight_logits[own.clone()].iter().map(|logit| logit.exp()).sum();
        let component = |k: usize| {
            let edge = |x: f64| (x - self.means[k]) / self.log_scales[k].exp();
            self.weight_logits[k].exp() / total * plain_logistic_interval(edge(low), edge(high))
        };
        own.map(component).sum()
    }
}
