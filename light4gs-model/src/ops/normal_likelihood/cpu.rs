//! Probabilities of unit intervals on a CPU.

use std::f32::consts::LOG2_E;

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

use super::{Measure, NormalBounds, NormalLikelihoodKernels, NormalLikelihoodOps, NormalTensors};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

/// Values that a thread takes at a time.
const CHUNK: usize = 1 << 12;

/// Coefficients of `ln(erfc(z) / t) + z²` in `t = 1 / (1 + z / 2)`, lowest power first.
/// `shaders/include/normal.wgsl` has the same.
const COEFFICIENTS: [f32; 10] = [
    -1.265_512_2,
    1.000_023_7,
    0.374_091_96,
    0.096_784_18,
    -0.186_288_06,
    0.278_868_07,
    -1.135_204,
    1.488_515_9,
    -0.822_152_23,
    0.170_872_77,
];

/// The standard normal distribution function at x, at most 0.
fn lower_tail(x: f32) -> f32 {
    let t = (1.0 - std::f32::consts::FRAC_1_SQRT_2 / 2.0 * x).recip();
    let (first, higher) = COEFFICIENTS.split_first().expect("ten coefficients");
    let polynomial = higher.iter().rev().fold(0.0, |sum, coefficient| (sum + coefficient) * t);
    0.5 * t * (polynomial + first - 0.5 * x * x).exp()
}

fn distribution(x: f32) -> f32 {
    if x > 0.0 { 1.0 - lower_tail(-x) } else { lower_tail(x) }
}

/// The standard normal density.
fn density(x: f32) -> f32 {
    /// 1 / sqrt(2 pi)
    const NORMALIZER: f32 = 0.398_942_3;
    NORMALIZER * (-0.5 * x * x).exp()
}

/// A value in its distribution.
struct Interval {
    /// The edges in standard deviations, on the lower side of the mean, where the distribution function is small and has full
    /// precision.
    edges: [f32; 2],
    /// The bounded standard deviation.
    scale: f32,
}

impl Interval {
    fn new([value, mean, scale]: [f32; 3], bounds: NormalBounds) -> Self {
        let distance = -(value - mean).abs();
        let scale = raised(scale, bounds.scale);
        Self { edges: [(distance + 0.5) / scale, (distance - 0.5) / scale], scale }
    }

    /// Without bound.
    fn likelihood(&self) -> f32 {
        let [upper, lower] = self.edges.map(distribution);
        upper - lower
    }

    /// Derivatives of the likelihood by the distance from the mean, which is negative, and by the standard deviation.
    fn derivatives(&self) -> [f32; 2] {
        let [upper, lower] = self.edges;
        let [at_upper, at_lower] = self.edges.map(density);
        [(at_upper - at_lower) / self.scale, (at_lower * lower - at_upper * upper) / self.scale]
    }
}

/// At least the bound; NaN stays NaN, so that a training that has diverged is found.
fn raised(value: f32, bound: f32) -> f32 {
    if value < bound { bound } else { value }
}

/// The gradient through a lower bound: see [`lower_bound`](crate::ops::lower_bound::lower_bound).
fn through_bound(value: f32, bound: f32, gradient: f32) -> f32 {
    if value < bound && gradient >= 0.0 { 0.0 } else { gradient }
}

fn forward<B: HostBackend>(tensors: NormalTensors<B>, bounds: NormalBounds, measure: Measure) -> FloatTensor<B> {
    let shape = tensors.values.shape();
    let [values, parameters] = tensors.into_array().map(B::to_host);
    let values = values.as_slice();
    let (scales, means) = parameters.as_slice().split_at(values.len());
    let mut measured = vec![0.0; values.len()];
    measured.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, measured)| {
        for (i, measured) in (chunk * CHUNK..).zip(measured) {
            let likelihood = Interval::new([values[i], means[i], scales[i]], bounds).likelihood();
            let likelihood = raised(likelihood, bounds.likelihood);
            *measured = match measure {
                Measure::Likelihood => likelihood,
                Measure::Bits => -likelihood.log2(),
            };
        }
    });
    B::from_values(measured, shape)
}

fn backward<B: HostBackend>(
    tensors: NormalTensors<B>,
    bounds: NormalBounds,
    measure: Measure,
    upstream: FloatTensor<B>,
) -> NormalTensors<B> {
    let shapes = [tensors.values.shape(), tensors.parameters.shape()];
    let [values, parameters] = tensors.into_array().map(B::to_host);
    let values = values.as_slice();
    let (scales, means) = parameters.as_slice().split_at(values.len());
    let upstream = B::to_host(upstream);
    let upstream = upstream.as_slice();
    let mut of_values = vec![0.0; values.len()];
    let mut of_parameters = vec![0.0; 2 * values.len()];
    let (of_scales, of_means) = of_parameters.split_at_mut(values.len());
    let rows = of_values.par_chunks_mut(CHUNK).zip(of_means.par_chunks_mut(CHUNK)).zip(of_scales.par_chunks_mut(CHUNK));
    rows.enumerate().for_each(|(chunk, ((of_values, of_means), of_scales))| {
        let rows = of_values.iter_mut().zip(of_means).zip(of_scales);
        for (i, ((of_value, of_mean), of_scale)) in (chunk * CHUNK..).zip(rows) {
            let interval = Interval::new([values[i], means[i], scales[i]], bounds);
            let likelihood = interval.likelihood();
            let of_likelihood = match measure {
                Measure::Likelihood => upstream[i],
                Measure::Bits => -LOG2_E * upstream[i] / raised(likelihood, bounds.likelihood),
            };
            let gradient = through_bound(likelihood, bounds.likelihood, of_likelihood);
            let [by_distance, by_scale] = interval.derivatives();
            let offset = values[i] - means[i];
            // The distance has no derivative at the mean, where that of the likelihood is 0.
            *of_value = if offset > 0.0 { -gradient * by_distance } else { gradient * by_distance };
            *of_mean = -*of_value;
            *of_scale = through_bound(scales[i], bounds.scale, gradient * by_scale);
        }
    });
    let [of_values_shape, of_parameters_shape] = shapes;
    NormalTensors {
        values: B::from_values(of_values, of_values_shape),
        parameters: B::from_values(of_parameters, of_parameters_shape),
    }
}

for_cpu_back_ends! {
    NormalLikelihoodOps {
        fn normal_likelihood(
            tensors: NormalTensors<Self>,
            bounds: NormalBounds,
            measure: Measure,
        ) -> FloatTensor<Self> {
            forward(tensors, bounds, measure)
        }
    }
}

for_cpu_back_ends! {
    NormalLikelihoodKernels {
        fn normal_likelihood_backward(
            tensors: NormalTensors<Self>,
            bounds: NormalBounds,
            measure: Measure,
            upstream: FloatTensor<Self>,
        ) -> NormalTensors<Self> {
            backward(tensors, bounds, measure, upstream)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the standard normal distribution function to twelve digits (scipy.special.ndtr).
    #[test]
    fn the_distribution_function_keeps_its_digits() {
        let known = [
            (0.0f32, 0.5f64),
            (-0.5, 0.308_537_538_726),
            (-1.0, 0.158_655_253_931),
            (-2.0, 0.022_750_131_948_2),
            (-6.0, 9.865_876_450_38e-10),
            (-10.0, 7.619_853_024_16e-24),
            (1.0, 0.841_344_746_069),
            (3.0, 0.998_650_101_968),
        ];
        for (x, expected) in known {
            let found = f64::from(distribution(x));
            assert!((found / expected - 1.0).abs() < 3e-6, "{x}: {found} instead of {expected}");
        }
    }
}
