//! Resizing of float colors. Only this type of pixels is used: the general entry of `fast_image_resize`, and its
//! kernels for bytes, take longer to compile than everything else in this crate together.

use super::rgb::RgbImage8;
use crate::error::DataError;
use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::F32x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};

/// Resizes `source` = (width, height) colors in `[0, 1]`, row by row, to `target` with an antialiased filter, and
/// rounds them to bytes.
///
/// # Errors
/// [`DataError::Options`] when a size is 0 or does not fit the number of pixels.
pub(super) fn resize(
    pixels: &[F32x3],
    source: (u32, u32),
    target: (u32, u32),
    filter: FilterType,
) -> Result<RgbImage8, DataError> {
    let bad = |problem: String| DataError::Options { option: "resolution", problem };
    let (width, height) = target;
    let from = TypedImageRef::new(source.0, source.1, pixels).map_err(|e| bad(e.to_string()))?;
    let mut to = vec![F32x3::default(); width as usize * height as usize];
    let mut view = TypedImage::from_pixels_slice(width, height, &mut to).map_err(|e| bad(e.to_string()))?;
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(filter)).use_alpha(false);
    Resizer::new().resize_typed(&from, &mut view, &options).map_err(|e| bad(e.to_string()))?;
    let to_byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    Ok(RgbImage8 { width, height, pixels: to.into_iter().flat_map(|pixel| pixel.0.map(to_byte)).collect() })
}
