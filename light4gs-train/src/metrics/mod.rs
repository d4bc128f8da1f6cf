//! Metrics of how alike two images are, all differentiable. Images are `[H, W, 3]` in [0, 1].
//!
//! - here: L1, squared differences, PSNR
//! - `ssim`: SSIM in the field's two conventions, MS-SSIM and the D-SSIM of the tables
//! - [`lpips`]: the learned distance, with weights from a file
//! - `pixel_map`: a number for each pixel, of which a metric is the mean over a region
//! - `metric`: the metrics by name
//! - [`scores`]: the scores of one view, and over several views

pub mod lpips;
mod metric;
mod pixel_map;
pub mod scores;
mod ssim;

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::{PixelMask, RgbImage8};
use light4gs_model::ops::image_difference::{Difference, mean_difference, mean_difference_in_parts};

pub use metric::{Metric, RegionMetric};
pub use pixel_map::PixelMap;
pub use ssim::{MS_SSIM_LEAST_SIDE, WINDOW, d_ssim, ms_ssim, ssim, ssim_map, ssim_valid};

/// Mean absolute difference over pixels and channels, `[1]`. The truth gets no gradient.
pub fn l1(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    mean_difference(Difference::Absolute, image, truth)
}

/// Mean squared difference over pixels and channels, `[1]`. The truth gets no gradient.
pub fn l2(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    mean_difference(Difference::Squared, image, truth)
}

/// [`l1`] in parts that are to be added up, for a loss.
pub fn l1_in_parts(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    mean_difference_in_parts(Difference::Absolute, image, truth)
}

/// [`l2`] in parts that are to be added up, for a loss.
pub fn l2_in_parts(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    mean_difference_in_parts(Difference::Squared, image, truth)
}

/// Squared difference at every pixel and channel, `[H, W, 3]`.
pub fn squared_differences(image: Tensor<3>, truth: Tensor<3>) -> Tensor<3> {
    (image - truth).powi_scalar(2)
}

/// Peak signal-to-noise ratio in dB over the whole image, for a peak of 1.
pub fn psnr(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    decibels(l2(image, truth).into_scalar::<f64>())
}

/// The PSNR of a mean squared error, dB, for a peak of 1.
pub fn decibels(mean_squared_error: f64) -> f64 {
    -10.0 * mean_squared_error.log10()
}

/// A tensor `[H, W]`: 1 where a pixel counts, else 0.
pub fn mask_tensor(mask: &PixelMask, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = mask.pixels.iter().map(|value| f32::from(*value)).collect();
    Tensor::from_data(TensorData::new(values, [mask.height as usize, mask.width as usize]), device)
}

/// An 8-bit image as a tensor `[H, W, 3]` in [0, 1].
pub fn image_tensor(image: &RgbImage8, device: &Device) -> Tensor<3> {
    let values: Vec<f32> = image.pixels.iter().map(|byte| f32::from(*byte) / 255.0).collect();
    Tensor::from_data(TensorData::new(values, [image.height as usize, image.width as usize, 3]), device)
}
