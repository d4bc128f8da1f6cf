//! Exposures: a gain and an offset of each color channel.

use burn::tensor::Tensor;
use serde::Serialize;

/// Largest logarithm of a gain, either way: a factor of 4.
const MOST_LOG_GAIN: f32 = 1.386_294_4;
/// Largest offset, either way.
const MOST_OFFSET: f32 = 0.5;

/// `gain · color + offset` for red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exposure {
    /// 1 where nothing is corrected.
    pub gain: [f32; 3],
    /// In shares of white; 0 where nothing is corrected.
    pub offset: [f32; 3],
}

impl Exposure {
    /// From the logarithms of the gains and the offsets, the six numbers that are learned.
    pub(super) fn of(values: [f32; 6]) -> Self {
        let [red, green, blue, offset @ ..] = values;
        Self { gain: [red, green, blue].map(f32::exp), offset }
    }
}

/// The six numbers within what an exposure may be.
pub(super) fn bounded(values: [f32; 6]) -> [f32; 6] {
    std::array::from_fn(|k| {
        let most = if k < 3 { MOST_LOG_GAIN } else { MOST_OFFSET };
        values[k].clamp(-most, most)
    })
}

/// An image `[H, W, 3]` as a camera of this exposure shows it; `values [6]` are the logarithms of the gains and the offsets.
///
/// The background keeps its color: where an image is transparent, the dataset lays it over the background afterwards. So
/// gain and offset act on what `alpha [H, W]` covers. Pixels that the scene does not cover are the color of the background.
pub fn exposed(image: Tensor<3>, alpha: Tensor<2>, values: Tensor<1>, background: [f32; 3]) -> Tensor<3> {
    let part = |from: usize| values.clone().slice(from..from + 3).reshape([1, 1, 3]);
    let (gain, offset) = (part(0).exp(), part(3));
    let alpha = alpha.unsqueeze_dim::<3>(2);
    if background == [0.0; 3] {
        return image * gain + alpha * offset;
    }
    let background = Tensor::<1>::from_floats(background, &image.device()).reshape([1, 1, 3]);
    // gain (image - (1 - alpha) background) + alpha offset + (1 - alpha) background
    let uncovered = alpha.clone().neg().add_scalar(1.0) * background;
    (image - uncovered.clone()) * gain + alpha * offset + uncovered
}
