//! Masks as they are read, and the pixels of an image that are trained on.

use super::decode::decode_upright;
use super::undistort::{is_recorded_everywhere, undistort_mask};
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};
use std::path::Path;

/// `[H, W]` marks at the size of a frame's camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelMask {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `height * width` values, row-major: 1 where a pixel belongs to what is marked, otherwise 0.
    pub pixels: Vec<u8>,
}

/// The pixels that a frame may be trained on: all except those that its mask ignores, and those that its lens did not
/// record. `None` where it is all of them.
pub(super) fn trained_pixels(frame: &Frame) -> Result<Option<PixelMask>, DataError> {
    let ignored = frame.mask.as_ref().filter(|mask| mask.zero == MaskMeaning::Ignored);
    let size = (frame.source_width, frame.source_height);
    let bent = frame.lens.is_some_and(|lens| !is_recorded_everywhere(size, &frame.camera, &lens));
    match ignored {
        None if !bent => Ok(None),
        None => Ok(Some(at_camera(frame, vec![1; size.0 as usize * size.1 as usize]))),
        Some(mask) => {
            let mask = kept_pixels(frame, mask)?;
            Ok(mask.pixels.contains(&0).then_some(mask))
        }
    }
}

/// The pixels that a mask of kind [`MaskMeaning::Ignored`] does not ignore.
pub(super) fn kept_pixels(frame: &Frame, mask: &Mask) -> Result<PixelMask, DataError> {
    let marks = read(mask, (frame.source_width, frame.source_height))?;
    Ok(at_camera(frame, marks.into_iter().map(|value| u8::from(value != 0)).collect()))
}

/// The share of a frame's pixels that its mask keeps from being trained on. What a mask says about motion hides nothing.
pub(crate) fn hidden_share(frame: &Frame) -> Result<f64, DataError> {
    match frame.mask.as_ref().filter(|mask| mask.zero == MaskMeaning::Ignored) {
        None => Ok(0.0),
        Some(mask) => {
            let pixels = kept_pixels(frame, mask)?.pixels;
            Ok(pixels.iter().filter(|kept| **kept == 0).count() as f64 / pixels.len() as f64)
        }
    }
}

/// The mask's values at the size of the image's file, each from the nearest pixel.
pub(super) fn read(mask: &Mask, size: (u32, u32)) -> Result<Vec<u8>, DataError> {
    let found = super::image_size(&mask.path)?;
    let gray = decode_upright(&mask.path, found)?.into_luma8();
    check_shape(&mask.path, found, size)?;
    Ok(nearest(gray.as_raw(), found, size))
}

/// Refuses a mask of `found` pixels for an image of `size` pixels (width, height) where it is no smaller or larger version.
pub(crate) fn check_shape(path: &Path, found: (u32, u32), size: (u32, u32)) -> Result<(), DataError> {
    if !same_shape(found, size) {
        let problem = format!("the mask is {} x {} pixels, its image {} x {}", found.0, found.1, size.0, size.1);
        return Err(DataError::image(path, problem, "make masks of the images as they are"));
    }
    Ok(())
}

/// Whether one size (width, height) is a scaled version of the other, with sides rounded up or down.
pub(crate) fn same_shape(a: (u32, u32), b: (u32, u32)) -> bool {
    let (scale_x, scale_y) = (f64::from(a.0) / f64::from(b.0), f64::from(a.1) / f64::from(b.1));
    let rounding = |x: u32, y: u32| 1.0 / f64::from(x.min(y).max(1));
    (scale_x / scale_y).ln().abs() <= rounding(a.0, b.0) + rounding(a.1, b.1)
}

/// From marks at the size of the image's file to marks of the frame's camera.
fn at_camera(frame: &Frame, marks: Vec<u8>) -> PixelMask {
    let source = (frame.source_width, frame.source_height);
    let straight = match &frame.lens {
        Some(lens) => undistort_mask(&marks, source, &frame.camera, lens, 0),
        None => marks,
    };
    let (width, height) = (frame.camera.width, frame.camera.height);
    PixelMask { width, height, pixels: nearest(&straight, source, (width, height)) }
}

/// `[H, W]` marks at another size, each from the nearest pixel. Sizes are (width, height).
pub(super) fn nearest(values: &[u8], from: (u32, u32), to: (u32, u32)) -> Vec<u8> {
    if from == to {
        return values.to_vec();
    }
    let at = |i: u32, from: u32, to: u32| {
        let place = (f64::from(i) + 0.5) * f64::from(from) / f64::from(to);
        (place as usize).min(from.saturating_sub(1) as usize)
    };
    let columns: Vec<usize> = (0..to.0).map(|i| at(i, from.0, to.0)).collect();
    let rows = (0..to.1).map(|j| at(j, from.1, to.1) * from.0 as usize);
    rows.flat_map(|row| columns.iter().map(move |column| values[row + column])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::lens::{Distortion, Lens};
    use glam::Vec3;

    fn frame(folder: &Path, zero: MaskMeaning) -> Frame {
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 1.0, 8, 4);
        let mut frame = Frame::new("a", camera, 0.0, folder.join("a.png"), (16, 8));
        frame.mask = Some(Mask { path: folder.join("m.png"), zero });
        frame
    }

    #[test]
    fn masks_come_at_the_size_of_the_camera_with_their_meaning() {
        let folder = tempfile::tempdir().unwrap();
        // The left half is 0; the mask is half as large as the image.
        let mask = image::GrayImage::from_fn(8, 4, |x, _| image::Luma([if x < 4 { 0 } else { 200 }]));
        mask.save(folder.path().join("m.png")).unwrap();
        let right: Vec<u8> = [0, 0, 0, 0, 1, 1, 1, 1].repeat(4);
        let ignored = frame(folder.path(), MaskMeaning::Ignored);
        assert_eq!(trained_pixels(&ignored).unwrap().unwrap().pixels, right);
        // What moves is trained on like the rest.
        for meaning in [MaskMeaning::Moving, MaskMeaning::Still] {
            assert_eq!(trained_pixels(&frame(folder.path(), meaning)).unwrap(), None);
        }
        // A mask that lies on its side is refused.
        image::GrayImage::new(4, 8).save(folder.path().join("m.png")).unwrap();
        assert!(trained_pixels(&ignored).unwrap_err().to_string().contains("m.png"));
    }

    #[test]
    fn what_a_lens_did_not_record_is_not_trained_on() {
        let folder = tempfile::tempdir().unwrap();
        let with_lens = |k1: f64| {
            let distortion =
                Distortion::RadialTangential { radial: [k1, 0.0, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] };
            Frame { mask: None, lens: Lens::new(distortion, 0.0), ..frame(folder.path(), MaskMeaning::Moving) }
        };
        let pincushion = trained_pixels(&with_lens(2.0)).unwrap().unwrap();
        assert_eq!((pincushion.pixels[0], pincushion.pixels[2 * 8 + 4]), (0, 1));
        assert_eq!(trained_pixels(&with_lens(-0.1)).unwrap(), None);
    }
}
