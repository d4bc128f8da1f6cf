//! Regions: parts of a view's pixels, marked by the frame's mask, over which metrics are taken.

use super::mask::{PixelMask, kept_pixels, nearest, read};
use super::undistort::undistort_mask;
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};

/// A part of a view's pixels, as the frame's mask marks it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Region {
    /// Where something moves.
    Moving,
    /// Where nothing moves.
    Still,
    /// The pixels that are not ignored. Metrics over them are the masked metrics of DyCheck.
    Masked,
}

/// A pixel moves if at least `1 / MOVING_PART` of its area does.
const MOVING_PART: u64 = 4;

/// Marks of pixels: those that stand still, those that move, and those that the lens did not record.
const STILL: u8 = 0;
const MOVING: u8 = 1;
const UNRECORDED: u8 = 2;

/// The regions that a frame's mask marks, at the size of its camera; none without a mask.
///
/// A mask of motion gives [`Region::Moving`] and [`Region::Still`]. Where the camera is smaller than the mask, a pixel
/// moves if at least a quarter of its area does: moving things are small, and show in pixels that they cover only in
/// part. Pixels that the lens did not record belong to neither. A mask that ignores pixels gives [`Region::Masked`],
/// from the nearest pixels, as in training.
///
/// # Errors
/// [`DataError::Image`] where the mask cannot be read.
pub fn regions(frame: &Frame) -> Result<Vec<(Region, PixelMask)>, DataError> {
    match &frame.mask {
        None => Ok(Vec::new()),
        Some(mask) if mask.zero == MaskMeaning::Ignored => Ok(vec![(Region::Masked, kept_pixels(frame, mask)?)]),
        Some(mask) => moving_and_still(frame, mask),
    }
}

fn moving_and_still(frame: &Frame, mask: &Mask) -> Result<Vec<(Region, PixelMask)>, DataError> {
    let source = (frame.source_width, frame.source_height);
    let (width, height) = (frame.camera.width, frame.camera.height);
    let moves = |value: u8| (value != 0) == (mask.zero == MaskMeaning::Still);
    let mark = |value: u8| if moves(value) { MOVING } else { STILL };
    let mut marks: Vec<u8> = read(mask, source)?.into_iter().map(mark).collect();
    if let Some(lens) = &frame.lens {
        marks = undistort_mask(&marks, source, &frame.camera, lens, UNRECORDED);
    }
    let moving = covered(&marks, source, (width, height));
    let nearest = nearest(&marks, source, (width, height));
    let region = |wanted: bool| {
        let of = |(moving, nearest): (&bool, &u8)| u8::from(*moving == wanted && *nearest != UNRECORDED);
        PixelMask { width, height, pixels: moving.iter().zip(&nearest).map(of).collect() }
    };
    Ok(vec![(Region::Moving, region(true)), (Region::Still, region(false))])
}

/// For each pixel at the size `to`, whether at least `1 / MOVING_PART` of its area is [`MOVING`] in the marks `[H, W]`
/// at the size `from`. In whole numbers, so that a share of exactly that much counts on every machine.
fn covered(marks: &[u8], from: (u32, u32), to: (u32, u32)) -> Vec<bool> {
    let (columns, rows) = (overlaps(from.0, to.0), overlaps(from.1, to.1));
    let width = from.0 as usize;
    let area = u64::from(from.0) * u64::from(from.1);
    let mut moving = Vec::with_capacity(to.0 as usize * to.1 as usize);
    for row in &rows {
        for column in &columns {
            let of_row = |y: usize| -> u64 {
                let moves = |(x, _): &&(usize, u64)| marks[y * width + x] == MOVING;
                column.iter().filter(moves).map(|(_, length)| length).sum()
            };
            let share: u64 = row.iter().map(|(y, length)| of_row(*y) * length).sum();
            moving.push(share * MOVING_PART >= area);
        }
    }
    moving
}

/// A line of length `from * to` is divided into `to` parts of length `from`, and also into `from` parts of length `to`.
/// For each part of the first kind: the parts of the second kind that overlap it, and the lengths of the overlaps.
fn overlaps(from: u32, to: u32) -> Vec<Vec<(usize, u64)>> {
    let (from, to) = (u64::from(from), u64::from(to));
    let parts = |i: u64| {
        let (begin, end) = (i * from, (i + 1) * from);
        let length = |s: u64| ((s + 1) * to).min(end) - (s * to).max(begin);
        (begin / to..end.div_ceil(to)).map(|s| (s as usize, length(s))).collect()
    };
    (0..to).map(parts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::lens::{Distortion, Lens};
    use glam::Vec3;
    use std::path::Path;

    /// A frame of 16 × 8 pixels whose mask `m.png` has the values of `mask`, used at `size`.
    fn frame(folder: &Path, zero: MaskMeaning, mask: impl Fn(u32, u32) -> u8, size: (u32, u32)) -> Frame {
        let path = folder.join("m.png");
        image::GrayImage::from_fn(16, 8, |x, y| image::Luma([mask(x, y)])).save(&path).unwrap();
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 1.0, size.0, size.1);
        Frame { mask: Some(Mask { path, zero }), ..Frame::new("a", camera, 0.0, folder.join("a.png"), (16, 8)) }
    }

    fn pixels(found: &[(Region, PixelMask)], region: Region) -> Vec<u8> {
        found.iter().find(|(known, _)| *known == region).unwrap().1.pixels.clone()
    }

    #[test]
    fn a_mask_gives_the_regions_of_its_meaning() {
        let folder = tempfile::tempdir().unwrap();
        let left_is_zero = |x, _| if x < 8 { 0 } else { 200 };
        let right: Vec<u8> = [0, 0, 0, 0, 1, 1, 1, 1].repeat(4);
        let left: Vec<u8> = right.iter().map(|v| 1 - v).collect();
        let of = |zero| regions(&frame(folder.path(), zero, left_is_zero, (8, 4))).unwrap();
        let found = of(MaskMeaning::Moving);
        assert_eq!((pixels(&found, Region::Moving), pixels(&found, Region::Still)), (left.clone(), right.clone()));
        let found = of(MaskMeaning::Still);
        assert_eq!((pixels(&found, Region::Moving), pixels(&found, Region::Still)), (right.clone(), left));
        let found = of(MaskMeaning::Ignored);
        assert_eq!((found.len(), pixels(&found, Region::Masked)), (1, right));
        let without = Frame { mask: None, ..frame(folder.path(), MaskMeaning::Still, left_is_zero, (8, 4)) };
        assert!(regions(&without).unwrap().is_empty());
    }

    #[test]
    fn a_quarter_of_a_pixel_moves_it() {
        let folder = tempfile::tempdir().unwrap();
        let moving = |mask: &dyn Fn(u32, u32) -> u8, size| {
            let found = regions(&frame(folder.path(), MaskMeaning::Still, mask, size)).unwrap();
            let (moving, still) = (pixels(&found, Region::Moving), pixels(&found, Region::Still));
            assert!(moving.iter().zip(&still).all(|(moving, still)| moving + still == 1));
            moving
        };
        // One of the four pixels that become one.
        let dot = |x, y| u8::from((x, y) == (3, 2));
        assert_eq!(moving(&dot, (8, 4)).iter().position(|v| *v == 1), Some(8 + 1));
        assert_eq!(moving(&dot, (8, 4)).iter().sum::<u8>(), 1);
        // One of sixteen does not count, four of them do.
        assert_eq!(moving(&dot, (4, 2)), [0; 8]);
        assert_eq!(moving(&|x, y| u8::from(x / 2 == 1 && y / 2 == 1), (4, 2)), [1, 0, 0, 0, 0, 0, 0, 0]);
        // 16 columns become 6, each 8/3 wide: the first column is 3/8 of a pixel; the third is 2/8 of the first pixel
        // and 1/8 of the second. Rows stay.
        let of_column = |column| moving(&|x, _| u8::from(x == column), (6, 8))[..6].to_vec();
        assert_eq!(of_column(0), [1, 0, 0, 0, 0, 0]);
        assert_eq!(of_column(2), [1, 0, 0, 0, 0, 0]);
        assert_eq!(of_column(5), [0, 0, 1, 0, 0, 0]);
        // A larger camera.
        assert_eq!(moving(&dot, (32, 16)).iter().sum::<u8>(), 4);
    }

    #[test]
    fn what_a_lens_did_not_record_is_in_no_region() {
        let folder = tempfile::tempdir().unwrap();
        let distortion = Distortion::RadialTangential { radial: [2.0, 0.0, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] };
        let bent = Frame {
            lens: Lens::new(distortion, 0.0),
            ..frame(folder.path(), MaskMeaning::Still, |x, _| u8::from(x < 8), (8, 4))
        };
        let found = regions(&bent).unwrap();
        let at = |region, place: usize| pixels(&found, region)[place];
        let (corner, left, right) = (0, 8 + 3, 8 + 4);
        assert_eq!([corner, left, right].map(|place| at(Region::Moving, place)), [0, 1, 0]);
        assert_eq!([corner, left, right].map(|place| at(Region::Still, place)), [0, 0, 1]);
    }

    #[test]
    fn a_mask_that_cannot_be_read_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let frame = frame(folder.path(), MaskMeaning::Still, |_, _| 0, (8, 4));
        let message = || regions(&frame).unwrap_err().to_string();
        // On its side.
        image::GrayImage::new(4, 8).save(folder.path().join("m.png")).unwrap();
        assert!(message().contains("m.png") && message().contains("4 x 8"), "{}", message());
        std::fs::write(folder.path().join("m.png"), "no image").unwrap();
        assert!(message().contains("m.png"), "{}", message());
        std::fs::remove_file(folder.path().join("m.png")).unwrap();
        assert!(message().contains("m.png"), "{}", message());
    }
}
