//! The mean difference of two images, and its gradient.

use burn::backend::TensorMetadata;
use burn::backend::tensor::FloatTensor;
use rayon::prelude::*;

use super::{Difference, ImageDifferenceKernels};
use crate::ops::for_cpu_back_ends;
use crate::ops::host::HostBackend;

/// Numbers that are added up one after the other; the sums of such pieces are added in their order.
const CHUNK: usize = 1 << 14;

/// The mean over all numbers.
fn mean(difference: Difference, image: &[f32], truth: &[f32]) -> f32 {
    let chunks = image.par_chunks(CHUNK).zip(truth.par_chunks(CHUNK));
    let sum_of = |(image, truth): (&[f32], &[f32])| {
        image.iter().zip(truth).map(|(a, b)| f64::from(difference.of(a - b))).sum::<f64>()
    };
    let sums: Vec<f64> = chunks.map(sum_of).collect();
    (sums.into_iter().sum::<f64>() / image.len() as f64) as f32
}

/// The gradient of the image, from that of the mean.
fn gradient(difference: Difference, image: &[f32], truth: &[f32], upstream: f32) -> Vec<f32> {
    let scale = upstream / image.len() as f32;
    let mut gradient = vec![0.0; image.len()];
    let images = image.par_chunks(CHUNK).zip(truth.par_chunks(CHUNK));
    gradient.par_chunks_mut(CHUNK).zip(images).for_each(|(gradient, (image, truth))| {
        for ((gradient, a), b) in gradient.iter_mut().zip(image).zip(truth) {
            *gradient = scale * difference.slope(a - b);
        }
    });
    gradient
}

fn forward_on_cpu<B: HostBackend>(
    difference: Difference,
    image: FloatTensor<B>,
    truth: FloatTensor<B>,
) -> FloatTensor<B> {
    let (image, truth) = (B::to_host(image), B::to_host(truth));
    B::from_values(vec![mean(difference, image.as_slice(), truth.as_slice())], [1])
}

fn backward_on_cpu<B: HostBackend>(
    difference: Difference,
    image: FloatTensor<B>,
    truth: FloatTensor<B>,
    upstream: FloatTensor<B>,
) -> FloatTensor<B> {
    let shape = image.shape();
    let [image, truth, upstream] = [image, truth, upstream].map(B::to_host);
    B::from_values(gradient(difference, image.as_slice(), truth.as_slice(), upstream.as_slice()[0]), shape)
}

for_cpu_back_ends! {
    ImageDifferenceKernels {
        fn image_difference_forward(
            difference: Difference,
            image: FloatTensor<Self>,
            truth: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            forward_on_cpu::<Self>(difference, image, truth)
        }

        fn image_difference_backward(
            difference: Difference,
            image: FloatTensor<Self>,
            truth: FloatTensor<Self>,
            upstream: FloatTensor<Self>,
        ) -> FloatTensor<Self> {
            backward_on_cpu::<Self>(difference, image, truth, upstream)
        }
    }
}
