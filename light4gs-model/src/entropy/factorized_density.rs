//! A learned density for each channel (Ballé et al. 2018, appendix 6.1): a small monotone network gives the logit of the
//! distribution function.

use std::ops::Range;

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::softplus;
use burn::tensor::{Device, Distribution, Tensor};

use crate::ops::density_likelihood::{DensityLayer, DensityShape, density_likelihood};

/// Configuration of a [`FactorizedDensity`].
#[derive(Config, Debug)]
pub struct FactorizedDensityConfig {
    /// Channels, each with its own density.
    pub channels: usize,
    /// Widths of the hidden layers: at most four, each of width 1 to 3.
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
    ///
    /// # Panics
    /// If there are more hidden layers, or wider ones, than [`Self::filters`] allows.
    pub fn init(&self, device: &Device) -> FactorizedDensity {
        let channels = self.channels;
        let shape = DensityShape::new(&self.filters, self.bend_last_layer);
        let gain = self.initial_scale.powf(1.0 / shape.layers().len() as f64).recip();
        let parameters = shape.layers().iter().flat_map(|layer| {
            let value = (gain / layer.outputs as f64).exp_m1().ln();
            let matrix = Tensor::full([channels, layer.matrix().len()], value, device);
            let bias = Tensor::random([channels, layer.outputs], Distribution::Uniform(-0.5, 0.5), device);
            let factor = layer.factor().map(|places| Tensor::zeros([channels, places.len()], device));
            [matrix, bias].into_iter().chain(factor)
        });
        let parameters = Tensor::cat(parameters.collect(), 1);
        FactorizedDensity { parameters: Param::from_tensor(parameters), shape }
    }
}

/// Densities of `C` channels: layer `i` is `l <- softplus(M_i) l + b_i`, then `l <- l + tanh(f_i) tanh(l)` if it has
/// factors. All weights are positive and the nonlinearity is monotone, so the last `l` increases with x, and
/// `sigmoid(l)` is a distribution function.
#[derive(Module, Debug)]
pub struct FactorizedDensity {
    /// `[C, P]`: for each channel the matrix, the bias and the factor of each layer, as [`Self::shape()`] says. They are one
    /// parameter, so that a GPU takes one launch for all of them.
    pub parameters: Param<Tensor<2>>,
    #[module(skip)]
    shape: DensityShape,
}

impl FactorizedDensity {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.parameters.dims()[0]
    }

    /// The layers, and where the parameters of each stand.
    pub fn shape(&self) -> &DensityShape {
        &self.shape
    }

    /// `[C, out, in]` for each layer, which goes through softplus.
    pub fn matrices(&self) -> Vec<Tensor<3>> {
        let parameters = self.parameters.val();
        self.shape.layers().iter().map(|layer| matrix_of(&parameters, layer)).collect()
    }

    /// `[C, out, 1]` for each layer.
    pub fn biases(&self) -> Vec<Tensor<3>> {
        let parameters = self.parameters.val();
        self.shape.layers().iter().map(|layer| bias_of(&parameters, layer)).collect()
    }

    /// `[C, out, 1]` for each layer that bends, which goes through tanh; the last layer may have none.
    pub fn factors(&self) -> Vec<Tensor<3>> {
        let parameters = self.parameters.val();
        self.shape.layers().iter().filter_map(|layer| factor_of(&parameters, layer)).collect()
    }

    /// Logits of the distribution functions at `x [C, N]`: `[C, N]`.
    pub fn logits(&self, x: Tensor<2>) -> Tensor<2> {
        self.logits_with(x, &self.parameters.val())
    }

    /// [`Self::logits`] `[C, N]` at `x [C, N]`, without gradients to the density's own parameters.
    pub fn logits_of_frozen(&self, x: Tensor<2>) -> Tensor<2> {
        self.logits_with(x, &self.parameters.val().set_require_grad(false))
    }

    fn logits_with(&self, x: Tensor<2>, parameters: &Tensor<2>) -> Tensor<2> {
        let mut logits: Tensor<3> = x.unsqueeze_dim(1);
        for layer in self.shape.layers() {
            logits = mixed(softplus(matrix_of(parameters, layer), 1.0), logits) + bias_of(parameters, layer);
            if let Some(factor) = factor_of(parameters, layer) {
                logits = logits.clone() + factor.tanh() * tanh(logits);
            }
        }
        logits.squeeze_dim(1)
    }

    /// Probability of the interval of this width around each of `x [C, N]`: `[C, N]`, without a lower bound.
    pub fn interval_likelihood(&self, x: Tensor<2>, width: f32) -> Tensor<2> {
        density_likelihood(x, self.parameters.val(), &self.shape, width)
    }

    /// The same densities in float64 on the host.
    pub fn to_plain(&self) -> PlainDensity {
        PlainDensity {
            parameters: self.parameters.val().into_data().iter::<f64>().collect(),
            shape: self.shape.clone(),
            channels: self.channels(),
        }
    }
}

/// `[C, rows, columns]`: what stands in these places of the rows of `parameters [C, P]`.
fn part(parameters: &Tensor<2>, places: Range<usize>, [rows, columns]: [usize; 2]) -> Tensor<3> {
    let channels = parameters.dims()[0];
    parameters.clone().narrow(1, places.start, places.len()).reshape([channels, rows, columns])
}

fn matrix_of(parameters: &Tensor<2>, layer: &DensityLayer) -> Tensor<3> {
    part(parameters, layer.matrix(), [layer.outputs, layer.inputs])
}

fn bias_of(parameters: &Tensor<2>, layer: &DensityLayer) -> Tensor<3> {
    part(parameters, layer.bias(), [layer.outputs, 1])
}

fn factor_of(parameters: &Tensor<2>, layer: &DensityLayer) -> Option<Tensor<3>> {
    layer.factor().map(|places| part(parameters, places, [layer.outputs, 1]))
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

/// A [`FactorizedDensity`] in float64, without a back end, from which integer frequency tables are made.
#[derive(Clone, Debug)]
pub struct PlainDensity {
    /// `[C, P]`, row by row.
    parameters: Vec<f64>,
    shape: DensityShape,
    channels: usize,
}

impl PlainDensity {
    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Logit of a channel's distribution function at x.
    pub fn logit(&self, channel: usize, x: f64) -> f64 {
        let parameters = &self.parameters[channel * self.shape.parameters()..(channel + 1) * self.shape.parameters()];
        let mut logits = vec![x];
        for layer in self.shape.layers() {
            let (matrix, bias) = (&parameters[layer.matrix()], &parameters[layer.bias()]);
            let factor = layer.factor().map(|places| &parameters[places]);
            logits = (0..layer.outputs)
                .map(|row| {
                    let weights = matrix[row * layer.inputs..].iter().map(|weight| plain_softplus(*weight));
                    let product = weights.zip(&logits).map(|(weight, l)| weight * l);
                    let logit = product.sum::<f64>() + bias[row];
                    let bend = factor.map_or(0.0, |factor| factor[row].tanh());
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
