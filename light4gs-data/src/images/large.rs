//! Images of many megapixels, in memory that depends on the wanted size, not on that of the file.

use super::composite::composite;
use super::resize::resize;
use super::rgb::RgbImage8;
use crate::error::DataError;
use crate::regular_file::open_regular_file;
use fast_image_resize::{FilterType, pixels::F32x3};
use std::io::BufReader;
use std::path::Path;

/// Resizes `[H, W, 3]` bytes of `source` = (width, height) pixels: Lanczos with a window of radius 3, antialiased.
pub(super) fn resize_rgb(rgb: Vec<u8>, source: (u32, u32), target: (u32, u32)) -> Result<RgbImage8, DataError> {
    let (width, height) = target;
    if source == target {
        return Ok(RgbImage8 { width, height, pixels: rgb });
    }
    let colors: Vec<F32x3> =
        rgb.as_chunks::<3>().0.iter().map(|color| F32x3::new(color.map(|value| f32::from(value) / 255.0))).collect();
    resize(&colors, source, target, FilterType::Lanczos3)
}

/// Reads a PNG row by row and shrinks it while reading: first to means of whole blocks of pixels, which leave at least
/// twice the wanted size; then by the filter of [`resize_rgb`].
///
/// `None` if that does not help: the file is interlaced, so that its rows come in another order, or the image does not
/// become smaller by a factor of at least 2.
pub(super) fn shrink_png(
    path: &Path,
    target: (u32, u32),
    background: [f32; 3],
) -> Result<Option<RgbImage8>, DataError> {
    let damaged = |e: png::DecodingError| {
        DataError::image(
            path,
            format!("cannot be decoded ({e}): it is truncated or damaged"),
            "restore the file or remove its frame",
        )
    };
    let file = open_regular_file(path).map_err(DataError::io("read", path))?;
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let info = reader.info();
    let (width, height) = (info.width, info.height);
    let factor = (width / (2 * target.0).max(1)).min(height / (2 * target.1).max(1));
    if info.interlaced || factor < 2 {
        return Ok(None);
    }
    // Columns and rows that do not fill a whole block are added to the last block.
    let (columns, rows) = (width / factor, height / factor);
    let mut small = Vec::with_capacity(columns as usize * rows as usize * 3);
    let mut sums = vec![[0u32; 4]; columns as usize];
    let channels = reader.output_color_type().0.samples();
    let mut y = 0;
    while let Some(row) = reader.next_row().map_err(damaged)? {
        let rgba: Vec<u8> = row.data().chunks_exact(channels).flat_map(to_rgba).collect();
        for (x, pixel) in composite(&rgba, background).chunks_exact(3).enumerate() {
            let sum = &mut sums[(x / factor as usize).min(columns as usize - 1)];
            for (total, value) in sum.iter_mut().zip(pixel) {
                *total += u32::from(*value);
            }
            sum[3] += 1;
        }
        y += 1;
        // The last block of rows takes the remaining rows.
        if (y % factor == 0 && y / factor < rows) || y == height {
            for sum in &mut sums {
                let count = sum[3].max(1);
                small.extend([0, 1, 2].map(|c| ((sum[c] + count / 2) / count) as u8));
                *sum = [0; 4];
            }
        }
    }
    resize_rgb(small, (columns, rows), target).map(Some)
}

/// A pixel of 1 to 4 channels of 8 bits as red, green, blue, alpha.
fn to_rgba(pixel: &[u8]) -> [u8; 4] {
    match *pixel {
        [gray] => [gray, gray, gray, 255],
        [gray, alpha] => [gray, gray, gray, alpha],
        [red, green, blue] => [red, green, blue, 255],
        [red, green, blue, alpha, ..] => [red, green, blue, alpha],
        [] => [0; 4],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::composite_resized;

    #[test]
    fn row_by_row_gives_what_the_whole_image_gives() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        // Smooth, so that the filters agree; odd sizes, so that rows and columns remain after the blocks.
        let (width, height) = (1003u32, 757u32);
        let wave = |v: u32, period: f32| (127.5 + 127.0 * (v as f32 / period).sin()) as u8;
        let rgba: Vec<u8> = (0..width * height)
            .flat_map(|i| [wave(i % width, 90.0), wave(i / width, 70.0), wave(i % width + i / width, 130.0), 255])
            .collect();
        image::RgbaImage::from_raw(width, height, rgba.clone()).unwrap().save(&path).unwrap();
        let target = (50, 40);
        let small = shrink_png(&path, target, [1.0; 3]).unwrap().unwrap();
        let whole = composite_resized(&rgba, (width, height), target, [1.0; 3]).unwrap();
        assert_eq!((small.width, small.height), target);
        let worst = small.pixels.iter().zip(&whole.pixels).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 6, "{worst}");
        // Only a little smaller: `None`.
        assert!(shrink_png(&path, (400, 300), [1.0; 3]).unwrap().is_none());
    }

    #[test]
    fn every_color_type_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let gray16: Vec<u16> = vec![0x8080; 100 * 100];
        image::ImageBuffer::<image::Luma<u16>, _>::from_raw(100, 100, gray16).unwrap().save(&path).unwrap();
        assert_eq!(shrink_png(&path, (10, 10), [1.0; 3]).unwrap().unwrap().pixels, [128; 300]);
        let clear: Vec<u8> = [9, 0].repeat(100 * 100);
        image::GrayAlphaImage::from_raw(100, 100, clear).unwrap().save(&path).unwrap();
        assert_eq!(shrink_png(&path, (10, 10), [1.0; 3]).unwrap().unwrap().pixels, [255; 300]);
    }
}
