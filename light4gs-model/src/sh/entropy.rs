//! The interface of an entropy model of the spherical harmonics, and the values that a decoder has before it evaluates one.

use std::ops::RangeInclusive;

use burn::tensor::{Device, Distribution, Tensor};
use light4gs_codec::{CodecError, ShCoding, ShPrior};

use super::tables::table_coding;

use crate::entropy::gaussian_conditional::{self, NormalParameters};
use crate::planes::PlaneTensors;

/// Channels of the higher spherical harmonics.
pub const SH_CHANNELS: usize = 45;

/// Values of the Gaussians that are decoded before their spherical harmonics.
#[derive(Clone, Debug)]
pub struct ShKnown {
    /// Degree-0 spherical harmonics, `[N, 1, 3]`.
    pub sh_dc: Tensor<3>,
    /// Positions in the scene's coordinates, `[N, 3]` in [-1, 1].
    pub positions: Tensor<2>,
    /// All feature planes; empty where there are none.
    pub planes: PlaneTensors,
}

impl ShKnown {
    /// For models whose densities do not depend on the Gaussian (see [`ShTables`]): no Gaussian, no plane.
    pub fn nothing(device: &Device) -> Self {
        Self {
            sh_dc: Tensor::zeros([0, 1, 3], device),
            positions: Tensor::zeros([0, 3], device),
            planes: PlaneTensors::default(),
        }
    }
}

/// An entropy model of `sh_rest`. A model of your own implements this; the built-in ones are made with
/// [`channels_first`], [`gaussian_bits`] and [`ShNetwork`](crate::ShNetwork).
pub trait ShEntropy {
    /// Distance between the values of neighboring symbols.
    fn step(&self) -> f32;

    /// Bits of each value, `[N, 15, 3]`, of `values [N, 15, 3]`: noisy in training, quantized in an evaluation.
    /// Differentiable in the values, in `known` and in the weights.
    fn bits(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3>;

    /// Values with uniform noise of the step's width, which stands for rounding in training.
    fn add_noise(&self, values: Tensor<3>) -> Tensor<3> {
        let half = f64::from(self.step()) / 2.0;
        let noise = Tensor::random(values.dims(), Distribution::Uniform(-half, half), &values.device());
        values + noise
    }

    /// `values` as a decoder gets them, without gradient: the nearest multiples of the step, unless the model rounds
    /// around a prediction.
    fn quantize(&self, values: Tensor<3>, known: &ShKnown) -> Tensor<3> {
        let _ = known;
        (values.detach() / self.step()).round() * self.step()
    }

    /// The model's frequency tables, if its densities do not depend on the Gaussian; the file then has the tables.
    fn tables(&self) -> Option<&dyn ShTables> {
        None
    }

    /// The networks behind [`Self::bits`] for the codec's exact executor, with the same weights; empty for a model with
    /// tables.
    fn priors(&self) -> Vec<ShPrior> {
        Vec::new()
    }

    /// The coding with which a decoder can read `sh_rest`, `[N, 15, 3]` row-major. Tables extend as far as these
    /// values.
    ///
    /// # Errors
    /// Values that are not finite, or that span too many steps for a table.
    fn to_coding(&self, sh_rest: &[f32]) -> Result<ShCoding, CodecError> {
        let step = self.step();
        match self.tables() {
            Some(tables) => table_coding(sh_rest, step, |symbols| tables.pmf(symbols)),
            None => Ok(ShCoding::Networks { step, priors: self.priors() }),
        }
    }
}

/// An entropy model whose densities do not depend on the Gaussian: a frequency table for each channel.
pub trait ShTables {
    /// For each of the 45 channels the probabilities of these symbols (`value / step`), in float64 on the host.
    fn pmf(&self, symbols: RangeInclusive<i32>) -> Vec<Vec<f64>>;
}

/// `[45, N]` from `[N, 15, 3]`.
pub fn channels_first(values: Tensor<3>) -> Tensor<2> {
    let count = values.dims()[0];
    values.reshape([count, SH_CHANNELS]).transpose()
}

/// `[N, 15, 3]` from `[45, N]`.
pub fn channels_last(values: Tensor<2>) -> Tensor<3> {
    let count = values.dims()[1];
    values.transpose().reshape([count, SH_CHANNELS / 3, 3])
}

/// Bits `[C, N]` of `values [C, N]`, given a network's output `[2 C, 1, N]`: first scales, then means, in steps.
pub fn gaussian_bits(values: Tensor<2>, output: Tensor<3>, step: f32) -> Tensor<2> {
    gaussian_conditional::gaussian_bits(values / step, NormalParameters::of_network(output.squeeze_dim(1)))
}

/// `values [C, N]` rounded around the means of a network's output `[2 C, 1, N]`.
pub fn round_around(values: Tensor<2>, output: Tensor<3>, step: f32) -> Tensor<2> {
    let means = NormalParameters::<2>::of_network(output.squeeze_dim(1)).means();
    ((values / step - means.clone()).round() + means) * step
}
