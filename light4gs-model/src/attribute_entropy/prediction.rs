//! Linear predictions of the numbers of a Gaussian, from the same values as in the codec (`light4gs_codec::attributes`).

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use light4gs_codec::attributes::{CodingOrder, NEIGHBORS, least_squares};

use crate::ops::attribute_bits::prediction_inputs;
use crate::ops::linear::linear;

/// Added to the normal equations for each Gaussian, in units of a channel's variance.
const RIDGE: f64 = 1e-3;

/// Linear predictions of `C` channels from what a decoder already has: the channels of the same attribute before, for
/// the Gaussian itself and for those of its neighbors that are coded before it.
#[derive(Module, Debug)]
pub struct ChannelPrediction {
    /// `[C, 3 C]`: for each channel, the weights of the Gaussian's own channels, of their means over the neighbors, and of
    /// the channels of the nearest neighbor.
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

    /// The residuals of the channels, `[C, M]`. `inputs`, `[3 C, M]`, are the channels of each Gaussian, their means
    /// over its neighbors, and those of the nearest one, as
    /// [`neighborhoods`](crate::ops::neighborhoods::neighborhoods) finds them.
    pub fn residuals(&self, inputs: Tensor<2>) -> Tensor<2> {
        let channels = self.before.len();
        let own = inputs.clone().narrow(0, 0, channels);
        let weights = self.weights.val() * self.mask(&inputs.device());
        let nothing = Tensor::zeros([channels], &inputs.device());
        own - linear(inputs.transpose(), weights.transpose(), nothing).transpose()
    }

    /// The weights of the least squared error, `[C, 3 C]`, for all Gaussians of a table `[N, C]`, row by row, with their
    /// neighbors, `N`.
    pub fn fit(&self, table: &[f32], neighbors: &[[u32; NEIGHBORS]]) -> Tensor<2> {
        let channels = self.before.len();
        let count = neighbors.len();
        let value = |row: u32, channel: usize| f64::from(table[row as usize * channels + channel]);
        let by_channel = |number: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            (0..channels).map(|channel| (0..count).map(|row| number(row, channel)).collect()).collect()
        };
        let mut own = by_channel(&|row, channel| value(row as u32, channel));
        let mut around = by_channel(&|row, channel| {
            neighbors[row].iter().map(|&near| value(near, channel)).sum::<f64>() / NEIGHBORS as f64
        });
        let mut nearest = by_channel(&|row, channel| value(neighbors[row][0], channel));
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
        prediction_inputs(channel - self.before[channel], channel, self.before.len()).collect()
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

/// The neighbors of some Gaussians. Without an order each is its own neighbor.
pub(super) fn neighbors_of(order: Option<&CodingOrder>, rows: &[u32]) -> Vec<[u32; NEIGHBORS]> {
    match order {
        Some(order) => order.neighbors(rows),
        None => rows.iter().map(|&row| [row; NEIGHBORS]).collect(),
    }
}
