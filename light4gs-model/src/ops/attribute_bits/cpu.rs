//! Bits of the attributes on a CPU: the prediction as Burn's products, the densities eight residuals at a time.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;

use super::cpu_mixture::{MixtureSlices, bits_of_slices, mixture_bits_backward};
use super::{AttributeBitsKernels, AttributeBitsTensors, CountedBits, INPUTS, PositionSet, prediction_inputs};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::{HostBackend, HostTensor};

/// What the backward pass reads.
#[derive(Clone, Debug)]
pub struct CpuSaved<T> {
    /// `[3 C, M]`.
    numbers: T,
    /// `[C, 3 C]`: the weights of the prediction that are used, and zeros.
    weights: T,
    /// `[C, 3 C]`: 1 for those that are used.
    mask: T,
    residuals: HostTensor,
    /// Weight logits, means and logarithms of scales, `[C, K]` each.
    mixtures: [HostTensor; 3],
    steps: HostTensor,
    factors: HostTensor,
    counted: CountedBits,
}

impl<T> CpuSaved<T> {
    /// The widths of the intervals around the residuals of each channel.
    fn widths(&self) -> Vec<f32> {
        let steps = self.steps.as_slice();
        self.counted.by_channel().map(|(_, attribute)| steps[attribute.place]).collect()
    }

    fn mixtures<'a>(&'a self, widths: &'a [f32]) -> MixtureSlices<'a> {
        let [weight_logits, means, log_scales] = self.mixtures.each_ref().map(HostTensor::as_slice);
        MixtureSlices { values: self.residuals.as_slice(), widths, weight_logits, means, log_scales }
    }
}

/// 1 for the weights of the prediction that are used, `[C, 3 C]`.
fn mask(counted: &CountedBits, channels: usize) -> Vec<f32> {
    let mut mask = vec![0.0; channels * 3 * channels];
    for (channel, attribute) in counted.by_channel() {
        let inputs = prediction_inputs(attribute.channels.start, channel, channels);
        inputs.for_each(|input| mask[channel * 3 * channels + input] = 1.0);
    }
    mask
}

/// `[C, M]`: the first C rows of `numbers [3 C, M]`, less their predictions.
fn residuals_of<B: HostBackend>(numbers: &FloatTensor<B>, weights: &FloatTensor<B>) -> HostTensor {
    let [channels, count] = [weights.shape()[0], numbers.shape()[1]];
    if count == 0 {
        // Burn's `ndarray` refuses products of nothing.
        return B::to_host(B::from_values(Vec::new(), [channels, 0]));
    }
    let by_gaussian = B::float_matmul(B::float_transpose(numbers.clone()), B::float_transpose(weights.clone()));
    let predicted = B::to_host(B::float_transpose(by_gaussian));
    let numbers = B::to_host(numbers.clone());
    let pairs = numbers.as_slice().iter().zip(predicted.as_slice());
    B::to_host(B::from_values(pairs.map(|(number, predicted)| number - predicted).collect(), [channels, count]))
}

/// The natural logarithms of the numbers of cells along each axis, added up.
fn cells(positions: &PositionSet, step: f32) -> f32 {
    positions.extent.iter().map(|extent| (extent / step + 1.0).ln()).sum()
}

/// The gradient of the logarithm of the positions' step, from that of their bits.
fn of_position_step(positions: &PositionSet, step: f32, upstream: f32) -> f32 {
    let by_logarithm = upstream * positions.scale();
    let by_step = positions.extent.iter().map(|extent| {
        let slope = by_logarithm * (extent / step + 1.0).recip();
        slope * (-extent / (step * step))
    });
    by_step.sum::<f32>() * step
}

fn forward<B: HostBackend>(
    tensors: AttributeBitsTensors<B>,
    counted: CountedBits,
) -> (FloatTensor<B>, CpuSaved<FloatTensor<B>>) {
    let ([numbers, prediction, log_steps, weight_logits, means, log_scales], factors) = tensors.into_parts();
    let channels = prediction.shape()[0];
    let mask = B::from_values(mask(&counted, channels), [channels, 3 * channels]);
    let weights = B::float_mul(prediction, mask.clone());
    let saved = CpuSaved {
        residuals: residuals_of::<B>(&numbers, &weights),
        numbers,
        weights,
        mask,
        mixtures: [weight_logits, means, log_scales].map(B::to_host),
        steps: B::to_host(B::float_exp(log_steps)),
        factors: B::to_host(factors),
        counted,
    };
    let CountedBits { positions, bound, share, weight, .. } = &saved.counted;
    let (steps, factors) = (saved.steps.as_slice(), saved.factors.as_slice());
    let of_positions = positions.as_ref().map_or(0.0, |positions| {
        let (further, by_cells) = positions.further_bits();
        let of_cells = if by_cells { cells(positions, steps[positions.place]) * positions.scale() } else { 0.0 };
        (of_cells + further) * weight
    });
    let of_channels = bits_of_slices(&saved.mixtures(&saved.widths()), *bound);
    let of_channels = saved.counted.by_channel().zip(of_channels);
    let of_channels = of_channels.map(|((_, attribute), bits)| bits * factors[attribute.place] * share * weight);
    let bits: Vec<f32> = std::iter::once(of_positions).chain(of_channels).collect();
    (B::from_values(bits, [1 + channels]), saved)
}

fn backward<B: HostBackend>(saved: CpuSaved<FloatTensor<B>>, gradient: FloatTensor<B>) -> [FloatTensor<B>; INPUTS] {
    let upstream = B::to_host(gradient);
    let upstream = upstream.as_slice();
    let CountedBits { positions, bound, share, weight, .. } = &saved.counted;
    let (channels, count) = (saved.weights.shape()[0], saved.numbers.shape()[1]);
    let (steps, factors) = (saved.steps.as_slice(), saved.factors.as_slice());
    let of_bits: Vec<f32> = (saved.counted.by_channel().zip(&upstream[1..]))
        .map(|((_, attribute), upstream)| upstream * weight * share * factors[attribute.place])
        .collect();
    let gradients = mixture_bits_backward(&saved.mixtures(&saved.widths()), *bound, &of_bits);

    let mut of_steps = vec![0.0; steps.len()];
    for ((_, attribute), of_width) in saved.counted.by_channel().zip(&gradients.widths) {
        of_steps[attribute.place] += of_width;
    }
    of_steps.iter_mut().zip(steps).for_each(|(of_step, step)| *of_step *= step);
    if let Some(positions) = positions {
        let place = positions.place;
        of_steps[place] += of_position_step(positions, steps[place], upstream[0] * weight);
    }

    let [of_numbers, of_prediction] = of_residuals::<B>(&saved, gradients.values, [channels, count]);
    let matrix = |values: Vec<f32>| {
        let columns = values.len() / channels.max(1);
        B::from_values(values, [channels, columns])
    };
    [
        of_numbers,
        of_prediction,
        B::from_values(of_steps, [steps.len()]),
        matrix(gradients.weight_logits),
        matrix(gradients.means),
        matrix(gradients.log_scales),
    ]
}

/// Gradients of numbers and prediction from those of the residuals `[C, M]`.
fn of_residuals<B: HostBackend>(
    saved: &CpuSaved<FloatTensor<B>>,
    of_residuals: Vec<f32>,
    [channels, count]: [usize; 2],
) -> [FloatTensor<B>; 2] {
    let CpuSaved { numbers, weights, mask, .. } = saved;
    if count == 0 {
        let nothing = vec![0.0; channels * 3 * channels];
        return [numbers.clone(), B::from_values(nothing, [channels, 3 * channels])];
    }
    let of_predicted: Vec<f32> = of_residuals.iter().map(|gradient| -gradient).collect();
    let by_gaussian = B::float_transpose(B::from_values(of_predicted, [channels, count]));
    let of_numbers = B::float_matmul(by_gaussian.clone(), weights.clone());
    let mut of_numbers = B::to_host(B::float_transpose(of_numbers));
    for (of_number, of_residual) in of_numbers.as_mut_slice().iter_mut().zip(of_residuals) {
        *of_number += of_residual;
    }
    let of_weights = B::float_transpose(B::float_matmul(numbers.clone(), by_gaussian));
    [B::from_host(of_numbers), B::float_mul(of_weights, mask.clone())]
}

for_cpu_back_ends! {
    AttributeBitsKernels {
        type Saved = CpuSaved<FloatTensor<Self>>;

        fn attribute_bits_forward(
            tensors: AttributeBitsTensors<Self>,
            counted: CountedBits,
        ) -> (FloatTensor<Self>, Self::Saved) {
            forward::<Self>(tensors, counted)
        }

        fn attribute_bits_backward(saved: Self::Saved, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; INPUTS] {
            backward::<Self>(saved, gradient)
        }
    }
}
