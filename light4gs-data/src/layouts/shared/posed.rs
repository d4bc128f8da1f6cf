//! From images with poses, as a reader finds them, to the frames of a scene.

use super::files;
use super::names::Names;
use crate::camera::{Camera, Intrinsics, PoseError};
use crate::error::DataError;
use crate::frame::{Frame, Mask};
use crate::images::{self, ImageHeader, read_headers, turns_sideways};
use crate::lens::Lens;
use crate::options::LoadOptions;
use glam::{DMat3, DVec3};
use image::metadata::Orientation;
use rayon::prelude::*;
use std::collections::HashSet;
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
pub(in crate::layouts) fn frames(
    images: &[PosedImage],
    options: &LoadOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<Frame>, DataError> {
    let headers = read_headers(images.par_iter().map(|image| image.path.as_path()).collect::<Vec<_>>())?;
    let sizes: Vec<(u32, u32)> =
        images.iter().zip(&headers).map(|(image, header)| upright_size(image, *header)).collect::<Result<_, _>>()?;
    check_masks(images, &sizes)?;
    note_rotations(images, &headers, &sizes, notes);
    images.iter().zip(sizes).map(|(image, size)| frame(image, size, options)).collect()
}

fn frame(image: &PosedImage, source: (u32, u32), options: &LoadOptions) -> Result<Frame, DataError> {
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
        return check_shape(image, (width, height));
    }
    if turns_sideways(header.orientation) {
        return check_shape(image, (height, width));
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

/// The size of an image, if its shape is that of its camera's picture.
fn check_shape(image: &PosedImage, size: (u32, u32)) -> Result<(u32, u32), DataError> {
    let expected = (image.intrinsics.width, image.intrinsics.height);
    if images::same_shape(size, expected) {
        return Ok(size);
    }
    let file = image.described.0.display();
    let problem = format!(
        "it is {} x {} pixels, but {file} says that its camera is {} x {}: the shapes differ, so it was cropped or stretched \
         after its pose was estimated",
        size.0, size.1, expected.0, expected.1
    );
    let remedy =
        "use the images that the poses were estimated from, or correct size, focal lengths and principal point";
    Err(DataError::image(&image.path, problem, remedy))
}

/// Makes sure before training that masks are images, of the shape of what they mask. Their sizes may differ.
fn check_masks(posed: &[PosedImage], sizes: &[(u32, u32)]) -> Result<(), DataError> {
    let masked: Vec<_> =
        posed.iter().zip(sizes).filter_map(|(image, size)| Some((size, image.mask.as_ref()?))).collect();
    let headers = read_headers(masked.par_iter().map(|(_, mask)| mask.path.as_path()).collect::<Vec<_>>())?;
    masked
        .into_iter()
        .zip(headers)
        .try_for_each(|((size, mask), header)| images::check_shape(&mask.path, header.size, *size))
}

/// Says how many images have an EXIF rotation that is ignored.
fn note_rotations(images: &[PosedImage], headers: &[ImageHeader], sizes: &[(u32, u32)], notes: &mut Vec<String>) {
    let ignored = |(_, (header, size)): &(&PosedImage, (&ImageHeader, &(u32, u32)))| {
        header.orientation != Orientation::NoTransforms && header.size == **size
    };
    let mut turned = images.iter().zip(headers.iter().zip(sizes)).filter(ignored);
    if let Some((first, _)) = turned.next() {
        let (count, all, first) = (turned.count() + 1, images.len(), first.path.display());
        notes.push(format!(
            "{count} of the {all} images have an EXIF rotation that is ignored, as by the programs that estimate poses: if \
             the poses are those of turned images, turn the pixels; the first is {first}"
        ));
    }
}

/// How many images in the folders of the posed ones have no pose, with a note if there are any.
pub(in crate::layouts) fn note_unposed(folder: &Path, posed: &[PosedImage], notes: &mut Vec<String>) -> usize {
    let known: HashSet<&Path> = posed.iter().map(|image| image.path.as_path()).collect();
    let folders: HashSet<&Path> = posed.iter().filter_map(|image| image.path.parent()).collect();
    let images = folders.iter().flat_map(|folder| files::images(folder).unwrap_or_default());
    let unposed = images.filter(|path| !known.contains(path.as_path())).count();
    if unposed > 0 {
        let (folder, all) = (folder.display(), unposed + posed.len());
        notes.push(format!("{unposed} of the {all} images in {folder} have no pose and are left out"));
    }
    unposed
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

/// Leaves out the images whose file is missing or listed before, and adds notes; if more than half are missing, it is an
/// error.
///
/// `file_of` gives the file that an image should have, and the one that it has. Where it has none, a file is taken whose
/// name differs only in case, or in the form of Unicode.
pub(in crate::layouts) fn present<T>(
    described_in: &Path,
    images: Vec<T>,
    notes: &mut Vec<String>,
    file_of: impl Fn(&T) -> (PathBuf, Option<PathBuf>),
) -> Result<Vec<(T, PathBuf)>, DataError> {
    let count = images.len();
    let mut missing: Option<(PathBuf, usize)> = None;
    let mut copies: Option<(PathBuf, usize)> = None;
    let mut found = Vec::with_capacity(count);
    let (mut names, mut known) = (Names::default(), HashSet::new());
    for image in images {
        let (expected, path) = file_of(&image);
        match path.or_else(|| names.find(&expected).filter(|path| files::is_image(path) && path.is_file())) {
            Some(path) if known.insert(path.clone()) => found.push((image, path)),
            Some(path) => copies.get_or_insert((path, 0)).1 += 1,
            None => missing.get_or_insert((expected, 0)).1 += 1,
        }
    }
    if let Some((first, again)) = copies {
        notes.push(format!(
            "{again} entries of {} name an image for the second time and are left out; the first is {}",
            described_in.display(),
            first.display()
        ));
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
