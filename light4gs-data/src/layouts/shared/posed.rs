//! From images with poses, as a reader finds them, to the frames of a scene.

use super::files;
use crate::camera::{Camera, Intrinsics, PoseError};
use crate::error::DataError;
use crate::frame::{Frame, Mask};
use crate::images::{ImageHeader, orientation, read_headers, turns_sideways};
use crate::lens::Lens;
use crate::options::LoadOptions;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Most pixels of an image as it is used, so that several fit into memory.
const MAX_USED_PIXELS: u64 = 1 << 26;

/// An image of a capture, with the facts about it from the capture's files.
#[derive(Clone, Debug)]
pub(in crate::layouts) struct PosedImage {
    pub(in crate::layouts) name: String,
    pub(in crate::layouts) path: PathBuf,
    pub(in crate::layouts) mask: Option<Mask>,
    /// World to camera, OpenCV axes.
    pub(in crate::layouts) rotation: DMat3,
    /// World units.
    pub(in crate::layouts) center: DVec3,
    /// In pixels of the size that the capture's files name. The image itself may have another size.
    pub(in crate::layouts) intrinsics: Intrinsics,
    pub(in crate::layouts) lens: Option<Lens>,
    pub(in crate::layouts) camera_id: u32,
    /// In `[0, 1]`.
    pub(in crate::layouts) time: f64,
    /// The file that holds the pose, and the field, for messages.
    pub(in crate::layouts) described: (PathBuf, String),
}

/// Reads the headers of the images, and returns frames at the size that the options ask for.
pub(in crate::layouts) fn frames(images: &[PosedImage], options: &LoadOptions) -> Result<Vec<Frame>, DataError> {
    let headers = read_headers(images.par_iter().map(|image| image.path.as_path()).collect::<Vec<_>>())?;
    // Masks may have another size. This makes sure before training that they are images.
    read_headers(
        images.iter().filter_map(|image| image.mask.as_ref()).map(|mask| mask.path.as_path()).collect::<Vec<_>>(),
    )?;
    images.iter().zip(headers).map(|(image, header)| frame(image, header, options)).collect()
}

fn frame(image: &PosedImage, header: ImageHeader, options: &LoadOptions) -> Result<Frame, DataError> {
    let source = upright_size(image, header)?;
    let camera = camera(image, &image.intrinsics.resized(source.0, source.1))?;
    let (width, height) = used_size(&image.path, source, options)?;
    let mut frame =
        Frame::new(image.name.clone(), camera.resized(width, height), image.time as f32, image.path.clone(), source);
    frame.camera_id = image.camera_id;
    frame.mask.clone_from(&image.mask);
    frame.lens = image.lens;
    Ok(frame)
}

/// The camera of an image with these intrinsics.
pub(in crate::layouts) fn camera(image: &PosedImage, intrinsics: &Intrinsics) -> Result<Camera, DataError> {
    Camera::from_pose(image.rotation, image.center, intrinsics).map_err(|error| {
        let remedy = match error {
            PoseError::Intrinsics { .. } | PoseError::EmptyImage { .. } => "calibrate the camera again",
            _ => "export the pose again, without scaling or mirroring",
        };
        DataError::field(&image.described.0, image.described.1.clone(), error.to_string(), remedy)
    })
}

/// The size at which an image is used.
pub(in crate::layouts) fn used_size(
    path: &Path,
    source: (u32, u32),
    options: &LoadOptions,
) -> Result<(u32, u32), DataError> {
    let used = options.resolution.apply(source);
    if u64::from(used.0) * u64::from(used.1) > MAX_USED_PIXELS {
        return Err(DataError::image(
            path,
            format!("it would be used at {} x {} pixels, expected at most {MAX_USED_PIXELS} together", used.0, used.1),
            "ask for smaller images, for example with `--set data.resolution=1600`",
        ));
    }
    Ok(used)
}

/// The size of an image as its camera sees it. An image that lies on its side is rotated if its EXIF data say so.
/// Otherwise EXIF rotations are ignored, since the programs that estimate poses ignore them too.
fn upright_size(image: &PosedImage, header: ImageHeader) -> Result<(u32, u32), DataError> {
    let (width, height) = header.size;
    let (expected_width, expected_height) = (image.intrinsics.width, image.intrinsics.height);
    let sideways =
        (width > height && expected_width < expected_height) || (width < height && expected_width > expected_height);
    if !sideways {
        return Ok((width, height));
    }
    if turns_sideways(orientation(&image.path)?) {
        return Ok((height, width));
    }
    Err(DataError::image(
        &image.path,
        format!(
            "it is {width} x {height} pixels, but {} says that its camera is {expected_width} x {expected_height}: one \
             of them lies on its side",
            image.described.0.display()
        ),
        "turn the image, or estimate the poses again from the images as they are",
    ))
}

/// Adds a note with the number of images without a mask, where a capture has masks.
pub(in crate::layouts) fn note_unmasked(images: &[PosedImage], notes: &mut Vec<String>) {
    let without: Vec<&PosedImage> = images.iter().filter(|image| image.mask.is_none()).collect();
    if let Some(first) = without.first() {
        let (count, all, first) = (without.len(), images.len(), first.path.display());
        notes.push(format!(
            "{count} of the {all} images have no mask: they are trained on as a whole and left out of the figures of regions; \
             the first is {first}"
        ));
    }
}

/// The error about an image that exists, but in a format that cannot be decoded.
pub(in crate::layouts) fn other_format(path: &Path) -> DataError {
    let problem = "this format cannot be decoded, expected a PNG, JPEG or GIF image";
    let remedy = "convert the images, for example with `ffmpeg -i NAME.tif NAME.png`; the names may keep their old suffix in \
                  the dataset's files";
    DataError::image(path, problem, remedy)
}

/// Leaves out the images whose file is missing, and adds a note; if more than half are missing, it is an error.
///
/// `file_of` gives the file that an image should have, and the one that it has.
pub(in crate::layouts) fn present<T>(
    described_in: &Path,
    images: Vec<T>,
    notes: &mut Vec<String>,
    file_of: impl Fn(&T) -> (PathBuf, Option<PathBuf>),
) -> Result<Vec<(T, PathBuf)>, DataError> {
    let count = images.len();
    let mut missing: Option<(PathBuf, usize)> = None;
    let mut found = Vec::with_capacity(count);
    for image in images {
        match file_of(&image) {
            (_, Some(path)) => found.push((image, path)),
            (expected, None) => missing.get_or_insert((expected, 0)).1 += 1,
        }
    }
    let Some((first, absent)) = missing else {
        return Ok(found);
    };
    let described_in = described_in.display();
    if 2 * absent > count && files::is_of_other_format(&first) {
        return Err(other_format(&first));
    }
    if 2 * absent > count {
        return Err(DataError::image(
            &first,
            format!("missing; in all, {absent} of the {count} images that {described_in} names are missing"),
            "copy the images there, or name the folder that holds them",
        ));
    }
    notes.push(format!(
        "{absent} of the {count} images that {described_in} names are missing and left out; the first is {}",
        first.display()
    ));
    Ok(found)
}
