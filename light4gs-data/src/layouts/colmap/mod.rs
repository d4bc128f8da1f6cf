//! COLMAP: a sparse model (binary or text) and the images that it was made from.
//!
//! The model lies in `sparse/0`, `sparse`, `colmap/sparse/0`, `distorted/sparse/0` or the folder itself; where there
//! are several (COLMAP writes one for each part of the capture that it could connect), the one with the most images is
//! taken. The images lie in `images`, or a smaller version of them in `images_2`, `images_4`, `images_8`. COLMAP knows
//! no time: it comes from the images' names, see [`sequence`]. One folder of numbered frames is one moving camera;
//! folders `cam00`, `cam01`... with the same numbers are a rig.

mod binary;
pub(crate) mod model;
mod text;

use super::layout::DatasetLayout;
use super::shared::files;
use super::shared::names::Names;
use super::shared::posed::{self, PosedImage};
use super::shared::sequence::{Sequence, held_out, sequence};
use crate::error::DataError;
use crate::options::LoadOptions;
use crate::points::PointCloud;
use crate::scene::{Scene, SplitFrames};
use model::{Model, ModelPoints};
use std::path::{Path, PathBuf};

/// Folders that are tried, in this order. Each may hold a model, or folders `0`, `1`... with one model each.
const MODELS: [&str; 5] = ["sparse", "colmap/sparse", "distorted/sparse", "dense/sparse", "."];
/// Folders of images that are tried, in this order.
const IMAGES: [&str; 7] = ["images", "images_2", "images_4", "images_8", "input", "dense/images", "rgb"];

/// The layout `colmap`: a sparse model and its images.
#[derive(Clone, Copy, Debug, Default)]
pub struct Colmap;

impl DatasetLayout for Colmap {
    fn name(&self) -> &'static str {
        "colmap"
    }

    fn signature(&self) -> &'static str {
        "sparse/0/cameras.bin and images.bin, or both as .txt"
    }

    fn detect(&self, root: &Path) -> bool {
        !model_folders(root).is_empty()
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        let mut notes = Vec::new();
        let model = largest_model(root, &mut notes)?;
        let images_folder = find_images(root, &model)?;
        let posed = posed_images(&model, &images_folder, &mut notes)?;
        if model.points_not_finite > 0 {
            notes.push(format!(
                "{} points of the model are at no finite place and are left out",
                model.points_not_finite
            ));
        }
        let unposed = posed::note_unposed(&images_folder, &posed, &mut notes);
        if root.join("masks").is_dir() {
            notes.push("the folder masks/ is not read: COLMAP's masks hide what moves; to hide pixels from training, name masks in \
                        a transforms.json (mask_path), see docs/data.md".to_owned());
        }
        let names: Vec<String> = posed.iter().map(|image| image.name.clone()).collect();
        let Sequence { places, mut reading, .. } = sequence(&names, options);
        reading.unposed = unposed;
        let mut posed = posed;
        for (image, place) in posed.iter_mut().zip(&places) {
            (image.camera_id, image.time) = (place.camera, place.time);
            // A frame's name has no folders.
            image.name = frame_name(&image.name);
        }
        let splits = split(posed::frames(&posed, options, &mut notes)?, &held_out(&places));
        let points = match (model.points.is_empty(), PointCloud::find(root)?) {
            (_, Some(points)) => points,
            (false, None) => model.points,
            (true, None) => PointCloud::in_front_of(&splits.train, options),
        };
        let scene = Scene::new(self.name(), root, splits, points, options.background)?;
        Ok(scene.with_notes(notes).with_reading(reading))
    }
}

/// Sorts frames into training and test, each by time and camera; all of them together are the camera path of videos.
pub(super) fn split(frames: Vec<crate::frame::Frame>, tests: &[bool]) -> SplitFrames {
    let mut marked: Vec<_> = frames.into_iter().zip(tests).collect();
    marked.sort_by(|(a, _), (b, _)| a.time.total_cmp(&b.time).then(a.camera_id.cmp(&b.camera_id)));
    let mut splits = SplitFrames::default();
    for (frame, test) in marked {
        splits.video.push(crate::frame::Frame::without_image(frame.name.clone(), frame.camera, frame.time));
        if *test { splits.test.push(frame) } else { splits.train.push(frame) }
    }
    splits
}

/// `cam00/0001.png` as `cam00_0001`.
pub(super) fn frame_name(path: &str) -> String {
    let without_suffix = Path::new(path).with_extension("");
    without_suffix.to_string_lossy().replace(['/', '\\'], "_")
}

/// The folders that hold a model, binary or text, all of them in the same folder of the dataset.
fn model_folders(root: &Path) -> Vec<PathBuf> {
    let mut names = Names::default();
    for place in MODELS {
        let Some(place) = names.find(&root.join(place)) else { continue };
        let is_number = |path: &Path| files::name_of(path).bytes().all(|c| c.is_ascii_digit());
        let mut found = files::entries(&place, is_number).unwrap_or_default();
        found.retain(|folder| ["bin", "txt"].iter().any(|suffix| holds_model(folder, suffix)));
        if found.is_empty() && ["bin", "txt"].iter().any(|suffix| holds_model(&place, suffix)) {
            found.push(place);
        }
        if !found.is_empty() {
            return found;
        }
    }
    Vec::new()
}

/// A file of a model, whatever the case of its name.
fn model_file(folder: &Path, name: &str, suffix: &str) -> PathBuf {
    let path = folder.join(format!("{name}.{suffix}"));
    Names::default().find(&path).unwrap_or(path)
}

/// Whether the files of every model are there with this suffix.
fn holds_model(folder: &Path, suffix: &str) -> bool {
    ["cameras", "images"].iter().all(|name| model_file(folder, name, suffix).is_file())
}

/// The model with the most images; of equal ones the first.
fn largest_model(root: &Path, notes: &mut Vec<String>) -> Result<Model, DataError> {
    let folders = model_folders(root);
    let mut largest: Option<(&PathBuf, Model)> = None;
    for folder in &folders {
        let model = read_model(folder)?;
        if largest.as_ref().is_none_or(|(_, known)| model.images.len() > known.images.len()) {
            largest = Some((folder, model));
        }
    }
    let Some((folder, model)) = largest else {
        let expected = MODELS.map(|folder| format!("{folder}/0/cameras.bin")).join(", ");
        let problem = format!("no model, expected one of {expected} with its images.bin (or both as .txt)");
        return Err(DataError::field(root, "sparse", problem, "run COLMAP first"));
    };
    if folders.len() > 1 {
        let (count, all, folder) = (model.images.len(), folders.len(), folder.display());
        notes.push(format!("COLMAP left {all} models; {folder} is used, the largest, with {count} images"));
    }
    if ["bin", "txt"].iter().all(|suffix| holds_model(folder, suffix)) {
        let changed =
            |suffix: &str| std::fs::metadata(model_file(folder, "images", suffix)).and_then(|m| m.modified()).ok();
        let age = if changed("txt") > changed("bin") { ", although the text files are newer" } else { "" };
        let folder = folder.display();
        notes.push(format!("{folder} has a model in binary and one in text: the binary files are used{age}"));
    }
    Ok(model)
}

/// Reads the model of a folder.
pub(crate) fn read_model(folder: &Path) -> Result<Model, DataError> {
    let is_binary = holds_model(folder, "bin");
    let file = |name: &str| model_file(folder, name, if is_binary { "bin" } else { "txt" });
    let images_file = file("images");
    let (cameras, images) = if is_binary {
        (binary::cameras(&file("cameras"))?, binary::images(&images_file)?)
    } else {
        (text::cameras(&file("cameras"))?, text::images(&images_file)?)
    };
    let points_file = file("points3D");
    let ModelPoints { cloud: points, errors, not_finite } = match (points_file.is_file(), is_binary) {
        (false, _) => ModelPoints::default(),
        (true, true) => binary::points(&points_file)?,
        (true, false) => text::points(&points_file)?,
    };
    if images.is_empty() {
        let problem = "0 posed images, expected at least 2";
        return Err(DataError::field(&images_file, "images", problem, "COLMAP found no poses: see docs/data.md"));
    }
    if let Some(image) = images.iter().find(|image| !cameras.contains_key(&image.camera)) {
        let (name, camera) = (files::shorten(&image.name), image.camera);
        let problem = format!("image `{name}` is of camera {camera}, which {} lacks", file("cameras").display());
        return Err(DataError::field(&images_file, "camera", problem, "take both files from the same model"));
    }
    let error = (!points.is_empty()).then(|| errors / points.len() as f64);
    Ok(Model { cameras, images, points, error, points_not_finite: not_finite, images_file })
}

/// The folder that has most of the model's images.
fn find_images(root: &Path, model: &Model) -> Result<PathBuf, DataError> {
    let mut names = Names::default();
    let mut present = |folder: &Path| {
        let sample = model.images.iter().step_by(model.images.len().div_ceil(32).max(1));
        let path = |name: &str| files::inside(folder, &model.images_file, "image name", name).ok();
        let found = |path: &PathBuf| files::find_image(path).is_some();
        sample.filter_map(|image| path(&image.name)).filter(|path| found(path) || names.find(path).is_some()).count()
    };
    let folders = IMAGES.iter().chain(&["."]).rev().filter_map(|name| Names::default().find(&root.join(name)));
    let counted = folders.filter(|folder| folder.is_dir()).map(|folder| (present(&folder), folder));
    let best = counted.max_by_key(|(count, _)| *count).filter(|(count, _)| *count > 0);
    best.map(|(_, folder)| folder).ok_or_else(|| {
        let first = model.images.first().map_or("", |image| image.name.as_str());
        let mut places = IMAGES.iter().chain(&["."]).map(|name| root.join(name).join(first));
        if let Some(found) = places.find(|path| files::is_of_other_format(path)) {
            return posed::other_format(&found);
        }
        let expected = root.join("images").join(first);
        DataError::image(
            &expected,
            format!("missing, like every other image that {} names", model.images_file.display()),
            "copy the images into the folder `images`",
        )
    })
}

/// The images of the model that are there. The names keep their folders.
fn posed_images(model: &Model, folder: &Path, notes: &mut Vec<String>) -> Result<Vec<PosedImage>, DataError> {
    let mut wanted = Vec::with_capacity(model.images.len());
    for image in &model.images {
        let path = files::inside(folder, &model.images_file, "image name", &image.name)?;
        wanted.push((image, path));
    }
    let found = posed::present(&model.images_file, wanted, notes, |(_, path)| (path.clone(), files::find_image(path)))?;
    let posed = found.into_iter().map(|((image, _), path)| {
        let camera = model.cameras[&image.camera];
        PosedImage {
            name: image.name.clone(),
            path,
            mask: None,
            rotation: image.rotation,
            center: image.center,
            intrinsics: camera.intrinsics,
            lens: camera.lens,
            camera_id: 0,
            time: 0.0,
            described: (model.images_file.clone(), format!("image `{}`", files::shorten(&image.name))),
        }
    });
    Ok(posed.collect())
}
