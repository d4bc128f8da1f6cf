//! Images `[H, W, 3]` as bytes and as floats.

use crate::atomic::write_atomically;
use crate::error::DataError;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use std::path::Path;

/// An image `[H, W, 3]` of bytes, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbImage8 {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `height * width * 3` values, red, green and blue of a pixel together.
    pub pixels: Vec<u8>,
}

/// An image `[H, W, 3]` in `[0, 1]`, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbImage32 {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `height * width * 3` values, red, green and blue of a pixel together.
    pub pixels: Vec<f32>,
}

impl RgbImage8 {
    /// The same image as floats: `byte / 255`.
    pub fn to_f32(&self) -> RgbImage32 {
        RgbImage32::from_u8(self)
    }

    /// Writes an 8-bit RGB PNG; the file is complete or absent, never half-written.
    ///
    /// # Errors
    /// [`DataError::Io`] when the file cannot be written; [`DataError::Image`] when the number of
    /// values is not `height * width * 3`.
    pub fn save_png(&self, path: &Path) -> Result<(), DataError> {
        save_png(path, &self.pixels, self.width, self.height, ExtendedColorType::Rgb8)
    }

    /// Writes a JPEG of a quality from 1 to 100; the file is complete or absent, never half-written.
    ///
    /// # Errors
    /// As [`RgbImage8::save_png`].
    pub fn save_jpeg(&self, path: &Path, quality: u8) -> Result<(), DataError> {
        let (width, height, color) = (self.width, self.height, ExtendedColorType::Rgb8);
        check_length(path, &self.pixels, width, height, color)?;
        write_atomically(path, |out| {
            let encoder = JpegEncoder::new_with_quality(out, quality);
            encoder.write_image(&self.pixels, width, height, color).map_err(std::io::Error::other)
        })
    }
}

impl RgbImage32 {
    /// An image of bytes as floats: `byte / 255`.
    pub fn from_u8(image: &RgbImage8) -> Self {
        Self {
            width: image.width,
            height: image.height,
            pixels: image.pixels.iter().map(|&v| f32::from(v) / 255.0).collect(),
        }
    }

    /// The same image as bytes: clamped to `[0, 1]`, times 255, rounded (NaN becomes 0).
    pub fn to_u8(&self) -> RgbImage8 {
        RgbImage8 {
            width: self.width,
            height: self.height,
            pixels: self.pixels.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect(),
        }
    }

    /// Writes an 8-bit RGB PNG; the file is complete or absent, never half-written.
    ///
    /// # Errors
    /// As [`RgbImage8::save_png`].
    pub fn save_png(&self, path: &Path) -> Result<(), DataError> {
        self.to_u8().save_png(path)
    }
}

/// Writes bytes as a PNG, atomically.
pub(crate) fn save_png(
    path: &Path,
    pixels: &[u8],
    width: u32,
    height: u32,
    color: ExtendedColorType,
) -> Result<(), DataError> {
    check_length(path, pixels, width, height, color)?;
    write_atomically(path, |out| {
        PngEncoder::new(out).write_image(pixels, width, height, color).map_err(std::io::Error::other)
    })
}

fn check_length(
    path: &Path,
    pixels: &[u8],
    width: u32,
    height: u32,
    color: ExtendedColorType,
) -> Result<(), DataError> {
    let channels = u64::from(color.channel_count());
    let expected = u64::from(width) * u64::from(height) * channels;
    if pixels.len() as u64 != expected || expected == 0 {
        return Err(DataError::image(
            path,
            format!(
                "{} values for {width} x {height} pixels of {channels} channels, expected {expected} (and not 0)",
                pixels.len()
            ),
            "pass an image whose length matches its size",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_the_way_to_float_and_back() {
        let image = RgbImage8 { width: 16, height: 16, pixels: (0..768).map(|i| (i % 256) as u8).collect() };
        assert_eq!(image.to_f32().to_u8(), image);
    }

    #[test]
    fn out_of_range_values_are_clamped() {
        let image = RgbImage32 { width: 1, height: 1, pixels: vec![-3.0, f32::NAN, 7.0] };
        assert_eq!(image.to_u8().pixels, [0, 0, 255]);
    }

    #[test]
    fn png_round_trip_and_wrong_length() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let mut image = RgbImage8 { width: 3, height: 2, pixels: (0..18).collect() };
        image.save_png(&path).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb8().into_raw(), image.pixels);
        let jpeg = folder.path().join("a.jpg");
        image.save_jpeg(&jpeg, 85).unwrap();
        assert_eq!(image::image_dimensions(&jpeg).unwrap(), (3, 2));
        image.pixels.pop();
        assert!(matches!(image.save_jpeg(&jpeg, 85), Err(DataError::Image { .. })));
        assert!(matches!(image.save_png(&path), Err(DataError::Image { .. })));
    }
}
