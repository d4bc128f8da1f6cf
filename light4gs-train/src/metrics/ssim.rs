//! Structural similarity (Wang et al. 2004) and its multiscale variant (Wang, Simoncelli and Bovik 2003).
//!
//! The field has two conventions for the border, and tables rarely say which: windows that reach over the border into
//! zeros (3DGS and what descends from it), or only windows that lie inside (TensorFlow, and scikit-image with Gaussian
//! weights). Both have the 11×11 Gaussian window of sigma 1.5 here.

use burn::tensor::activation::relu;
use burn::tensor::module::{avg_pool2d, conv2d};
use burn::tensor::ops::{AvgPoolOptions, ConvOptions};
use burn::tensor::{Device, Tensor, TensorData, s};

/// Side of the window in pixels.
pub const WINDOW: usize = 11;
/// Standard deviation of the window in pixels.
const SIGMA: f32 = 1.5;
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;
/// Weights of the five scales of MS-SSIM, from the full image to the one of a sixteenth of its width.
const SCALE_WEIGHTS: [f32; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];
/// Images with a shorter side have no MS-SSIM: at the last scale a window must still fit inside.
pub const MS_SSIM_LEAST_SIDE: usize = (WINDOW - 1) * (1 << (SCALE_WEIGHTS.len() - 1)) + 1;

/// The windows that count.
#[derive(Clone, Copy)]
enum Windows {
    /// One at every pixel; pixels outside the image count as 0.
    Padded,
    /// Only windows that lie inside the image.
    Inside,
}

/// Numerators and denominators at every window, `[C, 1, H, W]` each.
struct Similarity {
    luminance: [Tensor<4>; 2],
    contrast_structure: [Tensor<4>; 2],
}

impl Similarity {
    /// Luminance times contrast times structure.
    fn full(self) -> Tensor<4> {
        let Self { luminance: [above, below], contrast_structure: [numerator, denominator] } = self;
        (above * numerator) / (below * denominator)
    }

    /// Contrast times structure.
    fn contrast_structure(self) -> Tensor<4> {
        let [numerator, denominator] = self.contrast_structure;
        numerator / denominator
    }
}

fn gaussian(device: &Device, shape: [usize; 4]) -> Tensor<4> {
    let center = (WINDOW / 2) as f32;
    let weights: Vec<f32> = (0..WINDOW).map(|i| (-(i as f32 - center).powi(2) / (2.0 * SIGMA * SIGMA)).exp()).collect();
    let sum: f32 = weights.iter().sum();
    let normalized = weights.iter().map(|w| w / sum).collect::<Vec<_>>();
    Tensor::from_data(TensorData::new(normalized, shape), device)
}

/// `[H, W, C]` to `[C, 1, H, W]`: channels become the batch, so that one separable filter processes all of them.
fn planes(image: Tensor<3>) -> Tensor<4> {
    let [height, width, channels] = image.dims();
    image.permute([2, 0, 1]).reshape([channels, 1, height, width])
}

fn similarity(x: Tensor<4>, y: Tensor<4>, windows: Windows) -> Similarity {
    let device = x.device();
    let (column, row) = (gaussian(&device, [1, 1, WINDOW, 1]), gaussian(&device, [1, 1, 1, WINDOW]));
    let half = match windows {
        Windows::Padded => WINDOW / 2,
        Windows::Inside => 0,
    };
    let blur = |t: Tensor<4>| {
        let t = conv2d(t, column.clone(), None, ConvOptions::new([1, 1], [half, 0], [1, 1], 1));
        conv2d(t, row.clone(), None, ConvOptions::new([1, 1], [0, half], [1, 1], 1))
    };
    let (mean_x, mean_y) = (blur(x.clone()), blur(y.clone()));
    let (xx, yy, xy) =
        (mean_x.clone() * mean_x.clone(), mean_y.clone() * mean_y.clone(), mean_x.clone() * mean_y.clone());
    let variance_x = blur(x.clone() * x.clone()) - xx.clone();
    let variance_y = blur(y.clone() * y.clone()) - yy.clone();
    let covariance = blur(x * y) - xy.clone();
    Similarity {
        luminance: [xy * 2.0 + C1, xx + yy + C1],
        contrast_structure: [covariance * 2.0 + C2, variance_x + variance_y + C2],
    }
}

/// SSIM as 3DGS has it: zeros around the image, averaged over all pixels and channels, `[1]`.
pub fn ssim(image: Tensor<3>, truth: Tensor<3>) -> Tensor<1> {
    similarity(planes(image), planes(truth), Windows::Padded).full().mean()
}

/// SSIM as TensorFlow has it, and scikit-image with Gaussian weights: the mean over windows inside the image, `[1]`; none
/// where the image is smaller than a window.
pub fn ssim_valid(image: Tensor<3>, truth: Tensor<3>) -> Option<Tensor<1>> {
    let [height, width, _] = image.dims();
    let fits = height.min(width) >= WINDOW;
    fits.then(|| similarity(planes(image), planes(truth), Windows::Inside).full().mean())
}

/// The map of which [`ssim`] is the mean: the similarity in the window around every pixel, in every channel, `[H, W,
/// C]`.
pub fn ssim_map(image: Tensor<3>, truth: Tensor<3>) -> Tensor<3> {
    let map = similarity(planes(image), planes(truth), Windows::Padded).full();
    map.squeeze_dim::<3>(1).permute([1, 2, 0])
}

/// MS-SSIM over five scales, windows inside the image, averaged over channels, `[1]`; none where a side is under
/// [`MS_SSIM_LEAST_SIDE`] pixels.
pub fn ms_ssim(image: Tensor<3>, truth: Tensor<3>) -> Option<Tensor<1>> {
    let [height, width, _] = image.dims();
    if height.min(width) < MS_SSIM_LEAST_SIDE {
        return None;
    }
    let (mut x, mut y) = (planes(image), planes(truth));
    let last = SCALE_WEIGHTS.len() - 1;
    let mut product: Option<Tensor<4>> = None;
    for (scale, weight) in SCALE_WEIGHTS.into_iter().enumerate() {
        let similarity = similarity(x.clone(), y.clone(), Windows::Inside);
        let map = if scale == last { similarity.full() } else { similarity.contrast_structure() };
        let factor = relu(map.mean_dims(&[2, 3])).powf_scalar(weight);
        product = Some(product.map_or(factor.clone(), |product| product * factor));
        if scale < last {
            (x, y) = (halved(x), halved(y));
        }
    }
    product.map(|product| product.mean())
}

/// Means of 2×2 pixels. An odd side gets a line of zeros before its first pixel, which counts.
fn halved(planes: Tensor<4>) -> Tensor<4> {
    let [_, _, height, width] = planes.dims();
    let padding = [(height % 2, height % 2), (width % 2, width % 2)];
    let halved = avg_pool2d(planes, AvgPoolOptions::new([2, 2]).with_padding_pairs(padding));
    halved.slice(s![.., .., 0..height.div_ceil(2), 0..width.div_ceil(2)])
}

/// The dissimilarity `(1 - similarity) / 2`. Applied to [`ms_ssim`] it is the D-SSIM in the tables of 4DGS and
/// Light4GS; some papers apply it to [`ssim`].
pub fn d_ssim(similarity: f64) -> f64 {
    (1.0 - similarity) / 2.0
}
