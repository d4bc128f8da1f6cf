//! Measures of how alike two images are, all differentiable. Images are `[H, W, 3]` in [0, 1].

use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::RgbImage8;

/// Side of the SSIM window in pixels.
const WINDOW: usize = 11;
/// Standard deviation of the SSIM window in pixels.
const SIGMA: f32 = 1.5;
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

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
    let mse: f32 = l2(image, truth).into_scalar();
    -10.0 * f64::from(mse).log10()
}

fn gaussian(device: &Device, shape: [usize; 4]) -> Tensor<4> {
    let center = (WINDOW / 2) as f32;
    let weights: Vec<f32> = (0..WINDOW).map(|i| (-(i as f32 - center).powi(2) / (2.0 * SIGMA * SIGMA)).exp()).collect();
    let sum: f32 = weights.iter().sum();
    let normalized = weights.iter().map(|w| w / sum).collect::<Vec<_>>();
    Tensor::from_data(TensorData::new(normalized, shape), device)
}

/// Structural similarity (Wang et al. 2004) with an 11×11 Gaussian window of sigma 1.5 and zero padding, averaged over
/// pixels and channels, `[1]`.
pub fn ssim(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    let device = image.device();
    let [height, width, channels] = image.dims();
    // Channels become the batch: one separable filter serves them all.
    let planes = |t: Tensor<3>| t.permute([2, 0, 1]).reshape([channels, 1, height, width]);
    let (x, y) = (planes(image), planes(truth));
    let (column, row) = (gaussian(&device, [1, 1, WINDOW, 1]), gaussian(&device, [1, 1, 1, WINDOW]));
    let blur = |t: Tensor<4>| {
        let half = WINDOW / 2;
        let t = conv2d(t, column.clone(), None, ConvOptions::new([1, 1], [half, 0], [1, 1], 1));
        conv2d(t, row.clone(), None, ConvOptions::new([1, 1], [0, half], [1, 1], 1))
    };
    let (mean_x, mean_y) = (blur(x.clone()), blur(y.clone()));
    let (xx, yy, xy) =
        (mean_x.clone() * mean_x.clone(), mean_y.clone() * mean_y.clone(), mean_x.clone() * mean_y.clone());
    let variance_x = blur(x.clone() * x.clone()) - xx.clone();
    let variance_y = blur(y.clone() * y.clone()) - yy.clone();
    let covariance = blur(x * y) - xy.clone();
    let numerator = (xy * 2.0 + C1) * (covariance * 2.0 + C2);
    let denominator = (xx + yy + C1) * (variance_x + variance_y + C2);
    (numerator / denominator).mean()
}

/// An 8-bit image as a tensor `[H, W, 3]` in [0, 1].
pub fn image_tensor(image: &RgbImage8, device: &Device) -> Tensor<3> {
    let values: Vec<f32> = image.pixels.iter().map(|byte| f32::from(*byte) / 255.0).collect();
    Tensor::from_data(TensorData::new(values, [image.height as usize, image.width as usize, 3]), device)
}
