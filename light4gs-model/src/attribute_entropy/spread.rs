//! How far off the prediction of a number is expected to be, from what a decoder already has.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use light4gs_codec::attributes::NEIGHBORS;

/// Added to distances, in steps, before their logarithm: less than a step off is no sign.
const LEAST: f64 = 0.5;

/// Widths of the densities of `C` channels at each Gaussian, in units of the channel's. The codec's contexts are the misses
/// of the channel before and of the neighbors; here stand the former, and how far the neighbors are from each other.
#[derive(Module, Debug)]
pub struct ResidualSpread {
    /// `[C, 2]`: the exponents with which the width follows the miss of the channel before, and the distance between the
    /// nearest neighbor and the mean of the neighbors.
    pub exponents: Param<Tensor<2>>,
    /// For each channel, whether it is the first of its attribute: then no channel is before it.
    #[module(skip)]
    first: Vec<bool>,
}

impl ResidualSpread {
    /// For attributes of these widths; the same width everywhere.
    pub fn new(widths: &[usize], device: &Device) -> Self {
        let first: Vec<bool> = widths.iter().flat_map(|&width| (0..width).map(|channel| channel == 0)).collect();
        Self { exponents: Param::from_tensor(Tensor::zeros([first.len(), 2], device)), first }
    }

    /// `[C, N]`: the factors, whose logarithms are about 0 in the mean of each channel. `residuals`, `[C, N]`, are what the
    /// prediction leaves; `near`, `[C, N · NEIGHBORS]`, the channels of the neighbors, the nearest first; `steps`, `[C, 1]`,
    /// the quantization steps. Differentiable in the exponents only.
    pub fn factors(&self, residuals: Tensor<2>, near: Tensor<2>, steps: Tensor<2>) -> Tensor<2> {
        let [channels, count] = residuals.dims();
        let device = residuals.device();
        let near = near.reshape([channels, count, NEIGHBORS]);
        let apart = near.clone().narrow(2, 0, 1).squeeze_dim::<2>(2) - near.mean_dim(2).squeeze_dim::<2>(2);
        let none = Tensor::zeros([1, count], &device);
        let missed = residuals / steps.clone();
        let before = Tensor::cat(vec![none, missed.narrow(0, 0, channels - 1)], 0);
        let mask: Vec<f32> = self.first.iter().map(|first| if *first { 0.0 } else { 1.0 }).collect();
        let mask = Tensor::<1>::from_floats(mask.as_slice(), &device).unsqueeze_dim::<2>(1);
        let exponent = |place| self.exponents.val().narrow(1, place, 1);
        let logarithms = exponent(0) * mask * centered(before) + exponent(1) * centered(apart / steps);
        logarithms.exp()
    }
}

/// Logarithms of distances, less their mean in each channel; constants.
fn centered(distances: Tensor<2>) -> Tensor<2> {
    let logarithms = (distances.detach().abs() + LEAST).log();
    let mean = logarithms.clone().mean_dim(1);
    logarithms - mean
}
