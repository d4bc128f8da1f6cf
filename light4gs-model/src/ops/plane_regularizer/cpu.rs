//! The regularizer of feature planes, with its gradients.

use std::sync::Arc;

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

use super::{LEAST_ROWS, PLANES, PlaneRegularizerKernels, PlaneWeights, RegularizedPlanes};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

/// The gradients of one plane.
#[derive(Clone, Debug)]
pub struct PlaneGradient {
    shape: [usize; 3],
    values: Vec<f32>,
}

/// The loss of one channel `[H, W]`, whose gradients are added. The weights are those of one number.
fn channel_loss(values: &[f32], width: usize, [smoothness, distance]: [f32; 2], gradients: &mut [f32]) -> f64 {
    let mut loss = 0.0;
    if distance != 0.0 {
        for (value, gradient) in values.iter().zip(&mut *gradients) {
            let off = value - 1.0;
            loss += f64::from(distance * off.abs());
            *gradient = if off == 0.0 { 0.0 } else { distance * off.signum() };
        }
    }
    if smoothness == 0.0 {
        return loss;
    }
    for (rows, first) in values.windows(LEAST_ROWS * width).step_by(width).zip((0..).step_by(width)) {
        let [above, middle, below] = [0, 1, 2].map(|row| &rows[row * width..][..width]);
        let (own, rest) = gradients[first..].split_at_mut(width);
        let (of_middle, rest) = rest.split_at_mut(width);
        let mut squares = 0.0;
        for x in 0..width {
            let second = above[x] - 2.0 * middle[x] + below[x];
            squares += second * second;
            let by_second = 2.0 * smoothness * second;
            own[x] += by_second;
            of_middle[x] -= 2.0 * by_second;
            rest[x] += by_second;
        }
        loss += f64::from(smoothness * squares);
    }
    loss
}

/// The loss of a plane `[C, H, W]`, and its gradients.
fn plane_loss(values: &[f32], shape: [usize; 3], weights: PlaneWeights) -> (f64, PlaneGradient) {
    let [_, height, width] = shape;
    let mut gradients = vec![0.0; values.len()];
    if weights == PlaneWeights::default() || values.is_empty() {
        return (0.0, PlaneGradient { shape, values: gradients });
    }
    let of_numbers = weights.of_numbers(shape);
    let channels = gradients.par_chunks_mut(height * width).zip(values.par_chunks(height * width));
    let losses: Vec<f64> =
        channels.map(|(gradients, values)| channel_loss(values, width, of_numbers, gradients)).collect();
    (losses.into_iter().sum(), PlaneGradient { shape, values: gradients })
}

fn forward_on_cpu<B: HostBackend>(
    planes: RegularizedPlanes<B>,
    weights: [PlaneWeights; PLANES],
) -> (FloatTensor<B>, Arc<[PlaneGradient]>) {
    let planes = planes.into_array().into_iter().zip(weights).map(|(plane, weights)| {
        let shape = plane.shape().dims();
        plane_loss(B::to_host(plane).as_slice(), shape, weights)
    });
    let (losses, gradients): (Vec<f64>, Vec<PlaneGradient>) = planes.unzip();
    (B::from_values(vec![losses.iter().sum::<f64>() as f32], [1]), gradients.into())
}

fn backward_on_cpu<B: HostBackend>(
    derivatives: &[PlaneGradient],
    gradient: FloatTensor<B>,
) -> [FloatTensor<B>; PLANES] {
    let scale = B::to_host(gradient).as_slice()[0];
    std::array::from_fn(|plane| {
        let PlaneGradient { shape, values } = &derivatives[plane];
        B::from_values(values.iter().map(|value| scale * value).collect(), *shape)
    })
}

for_cpu_back_ends! {
    PlaneRegularizerKernels {
        type Derivatives = Arc<[PlaneGradient]>;

        fn plane_regularizer_forward(
            planes: RegularizedPlanes<Self>,
            weights: [PlaneWeights; PLANES],
        ) -> (FloatTensor<Self>, Arc<[PlaneGradient]>) {
            forward_on_cpu(planes, weights)
        }

        fn plane_regularizer_backward(
            derivatives: Arc<[PlaneGradient]>,
            gradient: FloatTensor<Self>,
        ) -> [FloatTensor<Self>; PLANES] {
            backward_on_cpu::<Self>(&derivatives, gradient)
        }
    }
}
