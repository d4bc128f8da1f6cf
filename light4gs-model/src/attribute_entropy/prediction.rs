//! What the numbers of a Gaussian are predicted from, as the codec predicts them (`light4gs_codec::attributes`).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use light4gs_codec::attributes::{CodingOrder, NEIGHBORS, least_squares};

use crate::ops::linear::linear;

/// Added to the normal equations for each Gaussian, in units of a channel's variance.
const RIDGE: f64 = 1e-3;

/// Linear predictions of `C` channels from what a decoder already has: the channels of the same attribute before, for
/// the Gaussian itself and for those of its neighbors that are coded before it.
#[derive(Module, Debug)]
pub struct ChannelPrediction {
    /// `[C, 3 C]`: how much of each channel of the Gaussian, of its mean over the neighbors, and of that of the nearest
    /// neighbor is in the prediction.
    pub weights: Param<Tensor<2>>,
    /// The channels before each in its attribute.
    #[module(skip)]
    before: Vec<usize>,
}

impl ChannelPrediction {
    /// For attributes of these widths; predicts 0.
    pub fn new(widths: &[usize], device: &Device) -> Self {
        let before: Vec<usize> = widths.iter().flat_map(|&width| 0..width).collect();
        let weights = Tensor::zeros([before.len(), 3 * before.len()], device);
        Self { weights: Param::from_tensor(weights), before }
    }

    /// What the prediction leaves of channels `[C, N]`; `near`, `[C, N · NEIGHBORS]`, are those of each one's neighbors,
    /// the nearest first.
    pub fn residuals(&self, own: Tensor<2>, near: Tensor<2>) -> Tensor<2> {
        let [channels, count] = own.dims();
        let near = near.reshape([channels, count, NEIGHBORS]);
        let around = near.clone().mean_dim(2).squeeze_dim::<2>(2);
        let nearest = near.narrow(2, 0, 1).squeeze_dim::<2>(2);
        let inputs = Tensor::cat(vec![own.clone(), around, nearest], 0);
        let weights = self.weights.val() * self.mask(&inputs.device());
        let nothing = Tensor::zeros([channels], &inputs.device());
        own - linear(inputs.transpose(), weights.transpose(), nothing).transpose()
    }

    /// The weights of the least squared error for channels as [`ChannelPrediction::residuals`] takes them, row by row.
    pub fn fit(&self, own: &[f32], near: &[f32]) -> Tensor<2> {
        let channels = self.before.len();
        let count = own.len() / channels.max(1);
        let rows = |values: &[f32], length: usize| -> Vec<Vec<f64>> {
            values.chunks_exact(length.max(1)).map(|row| row.iter().map(|&value| f64::from(value)).collect()).collect()
        };
        let (mut own, near) = (rows(own, count), rows(near, count * NEIGHBORS));
        let mut around: Vec<Vec<f64>> = near
            .iter()
            .map(|row| row.chunks_exact(NEIGHBORS).map(|near| near.iter().sum::<f64>() / NEIGHBORS as f64).collect())
            .collect();
        let mut nearest: Vec<Vec<f64>> =
            near.iter().map(|row| row.iter().step_by(NEIGHBORS).copied().collect()).collect();
        let means: Vec<f64> = own.iter().map(|row| row.iter().sum::<f64>() / count.max(1) as f64).collect();
        for table in [&mut own, &mut around, &mut nearest] {
            for (row, mean) in table.iter_mut().zip(&means) {
                row.iter_mut().for_each(|value| *value -= mean);
            }
        }
        let tables = [&own, &around, &nearest];
        let mut weights = vec![0.0; channels * 3 * channels];
        for channel in 0..channels {
            let inputs = self.inputs(channel);
            let variance = own[channel].iter().map(|value| value * value).sum::<f64>() / count.max(1) as f64;
            let found = least_squares(inputs.len(), count, RIDGE * variance.max(1e-20), |row, example| {
                for (number, &input) in example.iter_mut().zip(&inputs) {
                    *number = tables[input / channels][input % channels][row];
                }
                own[channel][row]
            });
            for (input, weight) in inputs.into_iter().zip(found) {
                weights[channel * 3 * channels + input] = weight as f32;
            }
        }
        let device = self.weights.val().device();
        Tensor::<1>::from_floats(weights.as_slice(), &device).reshape([channels, 3 * channels])
    }

    /// The columns of the weights of a channel.
    fn inputs(&self, channel: usize) -> Vec<usize> {
        let channels = self.before.len();
        let first = channel - self.before[channel];
        let own = first..channel;
        let around = channels + first..=channels + channel;
        own.chain(around).chain([2 * channels + channel]).collect()
    }

    /// 1 for the weights that may be used, `[C, 3 C]`.
    fn mask(&self, device: &Device) -> Tensor<2> {
        let channels = self.before.len();
        let mut mask = vec![0.0; channels * 3 * channels];
        for channel in 0..channels {
            self.inputs(channel).into_iter().for_each(|input| mask[channel * 3 * channels + input] = 1.0);
        }
        Tensor::<1>::from_floats(mask.as_slice(), device).reshape([channels, 3 * channels])
    }
}

/// The rows of the neighbors of each of some Gaussians, [`NEIGHBORS`] each. Without an order each is its own neighbor.
pub(super) fn neighbor_rows(order: Option<&CodingOrder>, rows: &[u32]) -> Vec<u32> {
    match order {
        Some(order) => order.neighbors(rows).into_flattened(),
        None => rows.iter().flat_map(|&row| [row; NEIGHBORS]).collect(),
    }
}
