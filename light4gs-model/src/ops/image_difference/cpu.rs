//! The mean difference of two images, and its gradient.

use rayon::prelude::*;

use crate::kernels::image_difference::Difference;

/// Numbers that are added up one after the other; the sums of such pieces are added in their order.
const CHUNK: usize = 1 << 14;

/// The mean over all numbers.
pub(crate) fn mean(difference: Difference, image: &[f32], truth: &[f32]) -> f32 {
    let chunks = image.par_chunks(CHUNK).zip(truth.par_chunks(CHUNK));
    let sum_of = |(image, truth): (&[f32], &[f32])| {
        image.iter().zip(truth).map(|(a, b)| f64::from(difference.of(a - b))).sum::<f64>()
    };
    let sums: Vec<f64> = chunks.map(sum_of).collect();
    (sums.into_iter().sum::<f64>() / image.len() as f64) as f32
}

/// The gradient of the image, from that of the mean.
pub(crate) fn gradient(difference: Difference, image: &[f32], truth: &[f32], upstream: f32) -> Vec<f32> {
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
