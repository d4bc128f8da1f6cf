//! The regularizer of feature planes, with its gradients.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

use super::{LEAST_ROWS, PLANES, PlaneRegularizerKernels, PlaneWeights, RegularizedPlanes};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

/// Values that are computed on together.
const LANES: usize = 8;

/// The loss of one channel `[H, W]`, and its gradients. The weights are those of one number.
fn channel_loss(values: &[f32], width: usize, [smoothness, distance]: [f32; 2], gradients: &mut [f32]) -> f64 {
    let height = values.len() / width;
    let row = |y: usize| &values[y * width..][..width];
    // The second differences around the row before, the own one and the next one; zeros where there are none.
    let [mut before, mut own, mut next] = [0, 1, 2].map(|_| vec![0.0; width]);
    let mut loss = 0.0;
    for (y, gradients) in gradients.chunks_exact_mut(width).enumerate() {
        if smoothness != 0.0 && y + LEAST_ROWS <= height {
            loss += f64::from(smoothness * second_differences([row(y), row(y + 1), row(y + 2)], &mut next));
        } else {
            next.fill(0.0);
        }
        for ((gradient, own), (before, next)) in gradients.iter_mut().zip(&own).zip(before.iter().zip(&next)) {
            *gradient = 2.0 * smoothness * (before - 2.0 * own + next);
        }
        if distance != 0.0 {
            loss += f64::from(distance * distances(row(y), distance, gradients));
        }
        (before, own, next) = (own, next, before);
    }
    loss
}

/// The second differences of three rows, and the sum of their squares.
fn second_differences([above, middle, below]: [&[f32]; LEAST_ROWS], to: &mut [f32]) -> f32 {
    for (((to, above), middle), below) in to.iter_mut().zip(above).zip(middle).zip(below) {
        *to = above - 2.0 * middle + below;
    }
    sum(to, |difference| difference * difference)
}

/// The sum of the distances from 1, whose gradients are added.
fn distances(values: &[f32], weight: f32, gradients: &mut [f32]) -> f32 {
    for (value, gradient) in values.iter().zip(gradients) {
        let off = value - 1.0;
        *gradient += if off == 0.0 { 0.0 } else { weight.copysign(off) };
    }
    sum(values, |value| (value - 1.0).abs())
}

/// A sum in lanes: one after another, additions would wait for each other.
fn sum(values: &[f32], term: impl Fn(f32) -> f32) -> f32 {
    let (vectors, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for vector in vectors {
        for (sum, value) in sums.iter_mut().zip(vector) {
            *sum += term(*value);
        }
    }
    sums.iter().sum::<f32>() + rest.iter().map(|value| term(*value)).sum::<f32>()
}

/// The loss of a plane `[C, H, W]`, and its gradients.
fn plane_loss(values: &[f32], shape: [usize; 3], weights: PlaneWeights) -> (f64, Vec<f32>) {
    let [_, height, width] = shape;
    let mut gradients = vec![0.0; values.len()];
    if weights == PlaneWeights::default() || values.is_empty() {
        return (0.0, gradients);
    }
    let of_numbers = weights.of_numbers(shape);
    let channels = gradients.par_chunks_mut(height * width).zip(values.par_chunks(height * width));
    let losses: Vec<f64> =
        channels.map(|(gradients, values)| channel_loss(values, width, of_numbers, gradients)).collect();
    (losses.into_iter().sum(), gradients)
}

fn forward_on_cpu<B: HostBackend>(
    planes: RegularizedPlanes<B>,
    weights: [PlaneWeights; PLANES],
) -> (FloatTensor<B>, [FloatTensor<B>; PLANES]) {
    let mut loss = 0.0;
    let mut weights = weights.into_iter();
    let gradients = planes.into_array().map(|plane| {
        let shape = plane.shape();
        let weights = weights.next().expect("one a plane");
        let (own, gradients) = plane_loss(B::to_host(plane).as_slice(), shape.dims(), weights);
        loss += own;
        B::from_values(gradients, shape)
    });
    (B::from_values(vec![loss as f32], [1]), gradients)
}

fn backward_on_cpu<B: HostBackend>(
    derivatives: [FloatTensor<B>; PLANES],
    gradient: FloatTensor<B>,
) -> [FloatTensor<B>; PLANES] {
    match B::to_host(gradient).as_slice()[0] {
        // Nearly always: the loss is a term of the one that is differentiated.
        1.0 => derivatives,
        scale => derivatives.map(|gradient| B::float_mul_scalar(gradient, scale.into())),
    }
}

for_cpu_back_ends! {
    PlaneRegularizerKernels {
        type Derivatives = [FloatTensor<Self>; PLANES];

        fn plane_regularizer_forward(
            planes: RegularizedPlanes<Self>,
            weights: [PlaneWeights; PLANES],
        ) -> (FloatTensor<Self>, Self::Derivatives) {
            forward_on_cpu(planes, weights)
        }

        fn plane_regularizer_backward(
            derivatives: Self::Derivatives,
            gradient: FloatTensor<Self>,
        ) -> [FloatTensor<Self>; PLANES] {
            backward_on_cpu::<Self>(derivatives, gradient)
        }
    }
}
