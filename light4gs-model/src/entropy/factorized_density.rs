//! A learned density for each channel (Ballé et al. 2018, appendix 6.1): a small monotone network gives the logit of the
//! distribution function.

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::softplus;
use burn::tensor::{Device, Distribution, Tensor};

/// Configuration of a [`FactorizedDensity`].
#[derive(Config, Debug)]
pub struct FactorizedDensityConfig {
    /// Channels, each with its own density.
    pub channels: usize,
    /// Widths of the hidden layers.
    #[config(default = "vec![3, 3, 3, 3]")]
    pub filters: Vec<usize>,
    /// The density is initially about this wide on either side of zero.
    #[config(default = 10.0)]
    pub initial_scale: f64,
    /// Whether the last layer has a nonlinearity too. CompressAI's has none.
    #[config(default = false)]
    pub bend_last_layer: bool,
}

impl FactorizedDensityConfig {
    /// CompressAI's initial values: biases uniform in ±0.5, everything else fixed.
    pub fn init(&self, device: &Device) -> FactorizedDensity {
        let channels = self.channels;
        let widths: Vec<usize> = [1].into_iter().chain(self.filters.iter().copied()).chain([1]).collect();
        let layers = widths.len() - 1;
        let gain = self.initial_scale.powf(1.0 / layers as f64).recip();
        let matrices = widths.windows(2).map(|pair| {
            let value = (gain / pair[1] as f64).exp_m1().ln();
            Param::from_tensor(Tensor::full([channels, pair[1], pair[0]], value, device))
        });
        let biases = widths[1..].iter().map(|width| {
            Param::from_tensor(Tensor::random([channels, *width, 1], Distribution::Uniform(-0.5, 0.5), device))
        });
        let bent = if self.bend_last_layer { layers } else { layers - 1 };
        let factors =
            widths[1..=bent].iter().map(|width| Param::from_tensor(Tensor::zeros([channels, *width, 1], device)));
        FactorizedDensity { matrices: matrices.collect(), biases: biases.collect(), factors: factors.collect() }
    }
}

/// Densities of `C` channels: layer `i` is `l <- softplus(M_i) l + b_i`, then `l <- l + tanh(f_i) tanh(l)` if it has
/// factors. All weights are positive and the nonlinearity is monotone, so the last `l` increases with x, and
/// `sigmoid(l)` is a distribution function.
#[derive(Module, Debug)]
pub struct FactorizedDensity {
    /// `[C, out, in]` for each layer, through softplus.
    pub matrices: Vec<Param<Tensor<3>>>,
    /// `[C, out, 1]` for each layer.
    pub biases: Vec<Param<Tensor<3>>>,
    /// `[C, out, 1]` for each layer, through tanh; the last layer may have none.
    pub factors: Vec<Param<Tensor<3>>>,
}

impl FactorizedDensity {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.matrices[0].dims()[0]
    }

    /// Logits of the distribution functions at `x [C, N]`: `[C, N]`.
    pub fn logits(&self, x: Tensor<2>) -> Tensor<2> {
        self.logits_with(x, |parameter| parameter.val())
    }

    /// [`Self::logits`] `[C, N]` at `x [C, N]`, without gradients to the density's own parameters.
    pub fn logits_of_frozen(&self, x: Tensor<2>) -> Tensor<2> {
        self.logits_with(x, |parameter| parameter.val().set_require_grad(false))
    }

    fn logits_with(&self, x: Tensor<2>, value: impl Fn(&Param<Tensor<3>>) -> Tensor<3>) -> Tensor<2> {
        let mut logits: Tensor<3> = x.unsqueeze_dim(1);
        for (i, (matrix, bias)) in self.matrices.iter().zip(&self.biases).enumerate() {
            logits = mixed(softplus(value(matrix), 1.0), logits) + value(bias);
            if let Some(factor) = self.factors.get(i) {
                logits = logits.clone() + value(factor).tanh() * tanh(logits);
            }
        }
        logits.squeeze_dim(1)
    }

    /// Probability of the interval of this width around each of `x [C, N]`: `[C, N]`, without a lower bound.
    pub fn interval_likelihood(&self, x: Tensor<2>, width: f32) -> Tensor<2> {
        let count = x.dims()[1];
        let edges = Tensor::cat(vec![x.clone() - width / 2.0, x + width / 2.0], 1);
        let edges = self.logits(edges);
        let lower = edges.clone().narrow(1, 0, count);
        let upper = edges.narrow(1, count, count);
        logistic_interval(lower, upper)
    }

    /// The same densities in float64 on the host.
    pub fn to_plain(&self) -> PlainDensity {
        let host = |parameters: &[Param<Tensor<3>>]| parameters.iter().map(PlainParameter::new).collect();
        PlainDensity {
            matrices: host(&self.matrices),
            biases: host(&self.biases),
            factors: host(&self.factors),
            channels: self.channels(),
        }
    }
}

/// `sigmoid(upper) - sigmoid(lower)`, computed on the side of zero where the sigmoids are small and so have full
/// precision.
pub(crate) fn logistic_interval<const D: usize>(lower: Tensor<D>, upper: Tensor<D>) -> Tensor<D> {
    let side = (lower.clone() + upper.clone()).detach().sign().neg();
    // Exactly in the middle, either side will do.
    let side = side.clone() + (side.abs() - 1.0).neg();
    (sigmoid(upper * side.clone()) - sigmoid(lower * side)).abs()
}

/// The product `[C, O, N]` of `matrix [C, O, I]` and `x [C, I, N]` as a sum over I. With few rows and columns and a
/// very long N, this is several times as fast as a matrix product, whose blocks would be nearly empty.
fn mixed(matrix: Tensor<3>, x: Tensor<3>) -> Tensor<3> {
    let inputs = x.dims()[1];
    let term = |input| matrix.clone().narrow(2, input, 1) * x.clone().narrow(1, input, 1);
    (1..inputs).fold(term(0), |sum, input| sum + term(input))
}

/// The hyperbolic tangent to 1e-7, computed with the exponential, which the CPU back ends vectorize: five times as fast
/// as their own function. Beyond the clamp it is 1 in float32.
fn tanh<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    ((x.clamp(-10.0, 10.0) * 2.0).exp() + 1.0).recip() * -2.0 + 1.0
}

/// The logistic function, also computed with the exponential. Beyond the clamp it is below 1e-26.
fn sigmoid<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    (x.clamp_min(-60.0).neg().exp() + 1.0).recip()
}

#[derive(Clone, Debug)]
struct PlainParameter {
    values: Vec<f64>,
    /// A channel's rows and columns.
    shape: [usize; 2],
}

impl PlainParameter {
    fn new(parameter: &Param<Tensor<3>>) -> Self {
        let [_, rows, columns] = parameter.dims();
        Self { values: parameter.val().into_data().iter::<f64>().collect(), shape: [rows, columns] }
    }

    fn at(&self, channel: usize, row: usize, column: usize) -> f64 {
        let [rows, columns] = self.shape;
        self.values[(channel * rows + row) * columns + column]
    }
}

/// A [`FactorizedDensity`] in float64, without a back end, from which integer frequency tables are made.
#[derive(Clone, Debug)]
pub struct PlainDensity {
    matrices: Vec<PlainParameter>,
    biases: Vec<PlainParameter>,
    factors: Vec<PlainParameter>,
    channels: usize,
}

impl PlainDensity {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Logit of a channel's distribution function at x.
    pub fn logit(&self, channel: usize, x: f64) -> f64 {
        let mut logits = vec![x];
        for (i, (matrix, bias)) in self.matrices.iter().zip(&self.biases).enumerate() {
            logits = (0..matrix.shape[0])
                .map(|row| {
                    let product =
                        logits.iter().enumerate().map(|(k, l)| plain_softplus(matrix.at(channel, row, k)) * l);
                    let logit = product.sum::<f64>() + bias.at(channel, row, 0);
                    let bend = self.factors.get(i).map_or(0.0, |factor| factor.at(channel, row, 0).tanh());
                    logit + bend * logit.tanh()
                })
                .collect();
        }
        logits[0]
    }

    /// Probability of a channel's interval from `low` to `high`.
    pub fn interval(&self, channel: usize, low: f64, high: f64) -> f64 {
        plain_logistic_interval(self.logit(channel, low), self.logit(channel, high))
    }

    /// The argument at which a channel's distribution function has this logit, by bisection, to about one part in
    /// 10^12.
    pub fn quantile(&self, channel: usize, logit: f64) -> f64 {
        let (mut low, mut high) = (-1.0, 1.0);
        // Far beyond anything that is coded. Without this bound, the search would not end where a density is flat.
        const FARTHEST: f64 = 1e9;
        while self.logit(channel, low) > logit && low > -FARTHEST {
            low *= 2.0;
        }
        while self.logit(channel, high) < logit && high < FARTHEST {
            high *= 2.0;
        }
        for _ in 0..80 {
            let middle = (low + high) / 2.0;
            if self.logit(channel, middle) < logit { low = middle } else { high = middle }
        }
        (low + high) / 2.0
    }
}

fn plain_softplus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// The logistic function in float64.
pub(crate) fn plain_sigmoid(x: f64) -> f64 {
    let e = (-x.abs()).exp();
    (if x >= 0.0 { 1.0 } else { e }) / (1.0 + e)
}

/// `sigmoid(upper) - sigmoid(lower)` in float64, as [`logistic_interval`].
pub(crate) fn plain_logistic_interval(lower: f64, upper: f64) -> f64 {
    let side = if lower + upper > 0.0 { -1.0 } else { 1.0 };
    (plain_sigmoid(side * upper) - plain_sigmoid(side * lower)).abs()
}
