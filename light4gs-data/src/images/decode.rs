//! From an image file to the `[H, W, 3]` bytes that are trained on: decoded, rotated, undistorted, composited, resized.

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
/// From this many pixels on an image is large: only one is decoded at a time, with less memory for each pixel.
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

/// Decodes an image that must have the size `expected`. One that lies on its side is rotated as its EXIF data say.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use glam::Vec3;

    /// A JPEG whose EXIF data say that it must be rotated by a quarter turn clockwise (orientation 6).
    fn sideways_jpeg(path: &Path) {
        let pixels =
            image::RgbImage::from_fn(64, 32, |x, _| image::Rgb(if x < 32 { [220, 20, 20] } else { [20, 20, 220] }));
        pixels.save(path).unwrap();
        let plain = std::fs::read(path).unwrap();
        let mut exif = b"\xff\xe1\x00\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01".to_vec();
        exif.extend(b"\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0");
        std::fs::write(path, [&plain[..2], &exif, &plain[2..]].concat()).unwrap();
    }

    #[test]
    fn an_image_on_its_side_is_turned_where_its_camera_stands_upright() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jpg");
        sideways_jpeg(&path);
        let upright = decode_upright(&path, (32, 64)).unwrap().into_rgb8();
        assert!(upright.get_pixel(16, 10)[0] > 150 && upright.get_pixel(16, 54)[2] > 150);
        // If the camera lies on its side like the file, the EXIF rotation is ignored, as COLMAP does.
        let stored = decode_upright(&path, (64, 32)).unwrap().into_rgb8();
        assert!(stored.get_pixel(10, 16)[0] > 150 && stored.get_pixel(54, 16)[2] > 150);
        assert!(decode_upright(&path, (30, 64)).unwrap_err().to_string().contains("expected 30 x 64"));
    }

    #[test]
    fn gray_and_sixteen_bit_images_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 4, 4);
        let frame = |name: &str| Frame::new(name, camera, 0.0, folder.path().join(name), (4, 4));
        image::GrayImage::from_pixel(4, 4, image::Luma([77])).save(folder.path().join("gray.png")).unwrap();
        assert_eq!(decode(&frame("gray.png"), [1.0; 3]).unwrap().pixels, [77; 48]);
        let deep = image::ImageBuffer::<image::Rgb<u16>, _>::from_pixel(4, 4, image::Rgb([0x4d4d, 0, 0xffff]));
        deep.save(folder.path().join("deep.PNG")).unwrap();
        assert_eq!(decode(&frame("deep.PNG"), [1.0; 3]).unwrap().pixels, [77, 0, 255].repeat(16));
    }

    #[test]
    fn a_large_image_takes_memory_for_what_is_wanted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large.png");
        // 9000 x 6000 gray pixels, a few kilobytes on the disk.
        image::GrayImage::from_pixel(9000, 6000, image::Luma([100])).save(&path).unwrap();
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 90, 60);
        let image = decode(&Frame::new("large", camera, 0.0, path, (9000, 6000)), [1.0; 3]).unwrap();
        assert_eq!(image.pixels, [100; 90 * 60 * 3]);
    }
}
