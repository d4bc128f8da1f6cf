//! Metrics of how alike two images are, all differentiable. Images are `[H, W, 3]` in [0, 1]; a mask is `[H, W]`, 1 where
//! pixels count and 0 where they do not.
//!
//! - here: L1, squared differences, PSNR
//! - `ssim`: SSIM in the field's two conventions, MS-SSIM and the D-SSIM of the tables
//! - [`lpips`]: the learned distance, with weights from a file
//! - [`scores`]: the metrics by name, and the scores of an image

pub mod lpips;
pub mod scores;
mod ssim;

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::{PixelMask, RgbImage8};

pub use ssim::{MS_SSIM_LEAST_SIDE, WINDOW, d_ssim, masked_ssim, ms_ssim, ssim, ssim_valid};

/// Mean absolute difference over pixels and channels, `[1]`.
pub fn l1(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    (image - truth).abs().mean()
}

/// Mean squared difference over pixels and channels, `[1]`.
pub fn l2(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    (image - truth).powi_scalar(2).mean()
}

/// Peak signal-to-noise ratio in dB over the whole image, for a peak of 1.
pub fn psnr(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    decibels(l2(image, truth))
}

/// [`psnr`] over the pixels of a mask.
pub fn masked_psnr(image: Tensor<3>, truth: Tensor<3>, mask: Tensor<2>) -> f64 {
    decibels(masked_mean((image - truth).powi_scalar(2), mask))
}

fn decibels(mean_squared_error: Tensor<1>) -> f64 {
    -10.0 * mean_squared_error.into_scalar::<f64>().log10()
}

/// Mean of a map `[H, W, C]` over the pixels of a mask, `[1]`; NaN where the mask is empty.
fn masked_mean(map: Tensor<3>, mask: Tensor<2>) -> Tensor<1> {
    let channels = map.dims()[2] as f32;
    let pixels = mask.clone().sum();
    (map * mask.unsqueeze_dim::<3>(2)).sum() / (pixels * channels)
}

/// Which pixels count as a tensor `[H, W]`: 1 where they do.
pub fn mask_tensor(mask: &PixelMask, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = mask.pixels.iter().map(|value| f32::from(*value)).collect();
    Tensor::from_data(TensorData::new(values, [mask.height as usize, mask.width as usize]), device)
}

/// An 8-bit image as a tensor `[H, W, 3]` in [0, 1].
pub fn image_tensor(image: &RgbImage8, device: &Device) -> Tensor<3> {
    let values: Vec<f32> = image.pixels.iter().map(|byte| f32::from(*byte) / 255.0).collect();
    Tensor::from_data(TensorData::new(values, [image.height as usize, image.width as usize, 3]), device)
}
