//! From an image file to the `[H, W, 3]` bytes that are trained on: decoded, turned, straightened, composited, resized.

use super::composite::{composite, composite_resized};
use super::header;
use super::large;
use super::rgb::RgbImage8;
use super::undistort::undistort;
use crate::error::DataError;
use crate::frame::Frame;
use image::{DynamicImage, ImageFormat};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Decoding a single image may take at most this much memory for the pixels as they are stored.
const MAX_DECODED_BYTES: u64 = 1 << 30;
/// From this many pixels on an image counts as large: it is decoded alone, and with less memory a pixel.
const LARGE_PIXELS: u64 = 1 << 24;

/// One large image at a time, however many threads ask for one.
static LARGE: Mutex<()> = Mutex::new(());

/// The image of a frame.
pub(super) fn decode(frame: &Frame, background: [f32; 3]) -> Result<RgbImage8, DataError> {
    if !frame.has_image() {
        return Err(DataError::image(
            Path::new(&frame.name),
            "this frame has no image, it belongs to a camera path",
            "use a frame of the train, test or val split",
        ));
    }
    let path = &frame.path;
    let found = header::read_header(path)?;
    let target = (frame.camera.width, frame.camera.height);
    let large = u64::from(found.size.0) * u64::from(found.size.1) > LARGE_PIXELS;
    let _alone = large.then(|| LARGE.lock().unwrap_or_else(PoisonError::into_inner));
    let source = (frame.source_width, frame.source_height);
    if large
        && found.format == ImageFormat::Png
        && found.size == source
        && frame.lens.is_none()
        && let Some(image) = large::shrink_png(path, target, background)?
    {
        return Ok(image);
    }
    let rgba = decode_upright(path, source)?.into_rgba8().into_raw();
    let rgba = match &frame.lens {
        Some(lens) => undistort(&rgba, source, &frame.camera, lens),
        None => rgba,
    };
    if large && target != source {
        let rgb = composite(&rgba, background);
        drop(rgba);
        return large::resize_rgb(rgb, source, target);
    }
    composite_resized(&rgba, source, target, background)
}

/// The pixels of an image that must be of the size `expected`. One that lies on its side is turned as its EXIF data say.
pub(super) fn decode_upright(path: &Path, expected: (u32, u32)) -> Result<DynamicImage, DataError> {
    let mut reader = header::open(path)?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    reader.limits(limits);
    let mut image = reader.decode().map_err(|e| {
        DataError::image(
            path,
            format!("cannot be decoded ({e}): it is truncated or damaged"),
            "restore the file or remove its frame",
        )
    })?;
    let stored = (image.width(), image.height());
    if stored != expected && (stored.1, stored.0) == expected {
        let orientation = header::orientation(path)?;
        if header::turns_sideways(orientation) {
            image.apply_orientation(orientation);
        }
    }
    let found = (image.width(), image.height());
    if found != expected {
        return Err(DataError::image(
            path,
            format!("it is {} x {} pixels, expected {} x {}", found.0, found.1, expected.0, expected.1),
            "it has changed since the dataset was opened: restore it, or start again",
        ));
    }
    Ok(image)
}
