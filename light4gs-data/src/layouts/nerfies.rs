//! The layouts of nerfies and HyperNeRF, and of NeRF-DS, which adds a second camera and masks.
//!
//! `dataset.json` names the images (`ids`, and which of them are `train_ids` and `val_ids`), `metadata.json` gives each
//! its `warp_id`, which counts time, and `camera_id`; `camera/ID.json` holds the camera at full size, `rgb/Nx/ID.png` the
//! images at an N-th of it. `orientation` is world to camera in OpenCV axes, `position` the camera's center, in the
//! units of `points.npy`; the scale and the center of `scene.json` are not applied, as in the reference.

use super::layout::DatasetLayout;
use super::shared::posed::{self, PosedImage};
use super::shared::times::TimeRange;
use super::shared::{files, json, npy};
use crate::camera::Intrinsics;
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};
use crate::lens::{Distortion, Lens};
use crate::options::LoadOptions;
use crate::points::PointCloud;
use crate::scene::{Reading, Scene, SplitFrames};
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Folders of images. The one with the most images is used; of equal ones the first, since the reference trains at half
/// size.
const SCALES: [&str; 5] = ["2x", "1x", "4x", "8x", "16x"];
/// Without `val_ids`, every fourth image is for training, and those half way between are for testing, as in the
/// reference.
const STRIDE: usize = 4;
/// The remedy for every bad field.
const REMEDY: &str = "export the capture again, or correct the field";

/// The layout `hypernerf`: nerfies and HyperNeRF captures.
#[derive(Clone, Copy, Debug, Default)]
pub struct HyperNerf;

/// The layout `nerfds`: NeRF-DS captures, two cameras (`ID_left`, `ID_right`) and masks of moving things.
#[derive(Clone, Copy, Debug, Default)]
pub struct NerfDs;

impl DatasetLayout for HyperNerf {
    fn name(&self) -> &'static str {
        "hypernerf"
    }

    fn signature(&self) -> &'static str {
        "dataset.json and camera/"
    }

    fn detect(&self, root: &Path) -> bool {
        root.join("dataset.json").is_file() && root.join("camera").is_dir()
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        open(self.name(), root, options)
    }
}

impl DatasetLayout for NerfDs {
    fn name(&self) -> &'static str {
        "nerfds"
    }

    fn signature(&self) -> &'static str {
        "dataset.json, camera/ID_left.json and mask/"
    }

    fn detect(&self, root: &Path) -> bool {
        let left = || files::entries(&root.join("camera"), |path| files::name_of(path).ends_with("_left.json"));
        HyperNerf.detect(root) && root.join("mask").is_dir() && left().is_ok_and(|found| !found.is_empty())
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        open(self.name(), root, options)
    }
}

/// The entries of `dataset.json` and `metadata.json` about an image.
struct Entry {
    id: String,
    time: f64,
    camera_id: u32,
    trains: bool,
    tests: bool,
}

fn open(layout: &'static str, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
    let (entries, reading) = read_entries(root)?;
    let folder = image_folder(root, &entries)?;
    let mut notes = Vec::new();
    let dataset = root.join("dataset.json");
    let entries = posed::present(&dataset, entries, &mut notes, |entry| {
        let base = folder.join(format!("{}.png", entry.id));
        let found = files::find_image(&base);
        (base, found)
    })?;
    let images: Vec<PosedImage> =
        entries.iter().map(|(entry, path)| read_camera(root, entry, path.clone())).collect::<Result<_, _>>()?;
    if root.join("mask").is_dir() {
        posed::note_unmasked(&images, &mut notes);
    }
    let mut splits = SplitFrames::default();
    for ((entry, _), frame) in entries.iter().zip(posed::frames(&images, options, &mut notes)?) {
        // The path of the camera through the capture, for videos.
        splits.video.push(Frame::without_image(entry.id.clone(), frame.camera, frame.time));
        if entry.tests {
            splits.test.push(frame.clone());
        }
        if entry.trains {
            splits.train.push(frame);
        }
    }
    let points = points(root, &splits, options)?;
    let scene = Scene::new(layout, root, splits, points, options.background)?;
    Ok(scene.with_notes(notes).with_reading(reading))
}

/// The images in the order of `dataset.json`, with times and splits, and where the times come from.
fn read_entries(root: &Path) -> Result<(Vec<Entry>, Reading), DataError> {
    let path = root.join("dataset.json");
    let document = json::read(&path)?;
    let ids = json::words(&path, "ids", document.get("ids"), REMEDY)?;
    if ids.is_empty() {
        return Err(DataError::field(&path, "ids", "a list of 0, expected at least one image", REMEDY));
    }
    for (i, id) in ids.iter().enumerate() {
        // An id is a part of file names.
        files::inside(root, &path, &format!("ids[{i}]"), id)?;
    }
    let list = |field: &str| match document.get(field) {
        None => Ok(Vec::new()),
        value => json::words(&path, field, value, REMEDY),
    };
    let (train_ids, val_ids) = (list("train_ids")?, list("val_ids")?);
    let known: HashSet<&str> = ids.iter().map(String::as_str).collect();
    for (field, named) in [("train_ids", &train_ids), ("val_ids", &val_ids)] {
        if let Some(i) = named.iter().position(|id| !known.contains(id.as_str())) {
            let problem = format!("`{}` is not among the {} `ids`", files::shorten(&named[i]), ids.len());
            return Err(DataError::field(&path, format!("{field}[{i}]"), problem, REMEDY));
        }
    }
    let train: HashSet<&str> = train_ids.iter().map(String::as_str).collect();
    let val: HashSet<&str> = val_ids.iter().map(String::as_str).collect();
    let two_cameras = ids.iter().any(|id| id.ends_with("_left")) && ids.iter().any(|id| id.ends_with("_right"));
    let metadata_path = root.join("metadata.json");
    let metadata = json::read(&metadata_path)?;
    let mut entries = Vec::with_capacity(ids.len());
    // Without `val_ids`, no test image follows the last training image.
    let last_trained = (ids.len() - 1) / STRIDE * STRIDE;
    for (i, id) in ids.iter().enumerate() {
        let (time, camera_id) = read_metadata(&metadata_path, id, metadata.get(id))?;
        let (trains, tests) = if !val.is_empty() {
            let tests = val.contains(id.as_str());
            (if train.is_empty() { !tests } else { train.contains(id.as_str()) }, tests)
        } else if two_cameras {
            (id.ends_with("_left"), id.ends_with("_right"))
        } else {
            (i % STRIDE == 0, i % STRIDE == STRIDE / 2 && i < last_trained)
        };
        entries.push(Entry { id: id.clone(), time, camera_id, trains, tests });
    }
    let times: Vec<f64> = entries.iter().map(|entry: &Entry| entry.time).collect();
    let range = TimeRange::of(&metadata_path, "warp_id", &times)?;
    for entry in &mut entries {
        entry.time = range.at(entry.time);
    }
    let times = format!("metadata.json, {range} mapped to 0 to 1");
    Ok((entries, Reading { times, ..Reading::default() }))
}

/// The number that counts time, and the camera.
fn read_metadata(path: &Path, id: &str, entry: Option<&Value>) -> Result<(f64, u32), DataError> {
    let name = files::shorten(id);
    let entry = entry.and_then(Value::as_object).ok_or_else(|| {
        DataError::field(path, name.clone(), "missing, expected an object with warp_id and camera_id", REMEDY)
    })?;
    let key = ["warp_id", "time_id", "appearance_id"].into_iter().find(|key| entry.contains_key(*key));
    let key = key.unwrap_or("warp_id");
    let field = format!("{name}.{key}");
    let time = json::finite(path, &field, entry.get(key), "a number of at least 0 that counts time", REMEDY)?;
    if time < 0.0 {
        return Err(DataError::field(path, field, format!("{time}, expected at least 0"), REMEDY));
    }
    let field = format!("{name}.camera_id");
    let camera = json::finite_or(path, &field, entry.get("camera_id"), 0.0, REMEDY)?;
    if camera < 0.0 || camera.fract() != 0.0 || camera > f64::from(u32::MAX) {
        return Err(DataError::field(path, field, format!("{camera}, expected a whole number"), REMEDY));
    }
    Ok((time, camera as u32))
}

/// The folder of images, at the scale that exists.
fn image_folder(root: &Path, entries: &[Entry]) -> Result<PathBuf, DataError> {
    let rgb = root.join("rgb");
    let present = |folder: &PathBuf| {
        entries.iter().filter(|entry| files::find_image(&folder.join(format!("{}.png", entry.id))).is_some()).count()
    };
    let folders = SCALES.iter().map(|scale| rgb.join(scale)).filter(|folder| folder.is_dir());
    // Of equal ones `max_by_key` takes the last.
    folders.rev().max_by_key(present).ok_or_else(|| {
        let expected = SCALES.map(|scale| format!("rgb/{scale}")).join(", ");
        DataError::field(
            root,
            "rgb",
            format!("no folder of images, expected one of {expected}"),
            "copy the images there",
        )
    })
}

fn read_camera(root: &Path, entry: &Entry, image: PathBuf) -> Result<PosedImage, DataError> {
    let path = root.join("camera").join(format!("{}.json", entry.id));
    let document = json::read(&path)?;
    let number = |field: &str, default: f64| json::finite_or(&path, field, document.get(field), default, REMEDY);
    let [x, y, z] = json::rows::<3, 3>(&path, "orientation", document.get("orientation"), REMEDY)?;
    let position = json::numbers::<3>(&path, "position", document.get("position"), REMEDY)?;
    let focal = json::finite(&path, "focal_length", document.get("focal_length"), "a positive number", REMEDY)?;
    let aspect = number("pixel_aspect_ratio", 1.0)?;
    let [width, height] = json::numbers::<2>(&path, "image_size", document.get("image_size"), REMEDY)?;
    if !(width >= 1.0 && height >= 1.0 && width <= 65_535.0 && height <= 65_535.0) {
        let problem = format!("{width} x {height}, expected 1 to 65535 pixels on each side");
        return Err(DataError::field(&path, "image_size", problem, REMEDY));
    }
    let [cx, cy] = match document.get("principal_point") {
        None => [width / 2.0, height / 2.0],
        value => json::numbers(&path, "principal_point", value, REMEDY)?,
    };
    let radial = match document.get("radial_distortion") {
        None => [0.0; 3],
        value => json::numbers(&path, "radial_distortion", value, REMEDY)?,
    };
    // Early nerfies captures use the shorter name.
    let name = if document.get("tangential").is_some() { "tangential" } else { "tangential_distortion" };
    let tangential = match document.get(name) {
        None => [0.0; 2],
        value => json::numbers(&path, name, value, REMEDY)?,
    };
    let skew = number("skew", 0.0)? / focal;
    let [k1, k2, k3] = radial;
    let distortion = Distortion::RadialTangential { radial: [k1, k2, k3, 0.0, 0.0, 0.0], tangential };
    Ok(PosedImage {
        name: entry.id.clone(),
        mask: find_mask(root, &image, &entry.id),
        path: image,
        rotation: DMat3::from_cols(x.into(), y.into(), z.into()).transpose(),
        center: DVec3::from(position),
        intrinsics: Intrinsics { width: width as u32, height: height as u32, fx: focal, fy: focal * aspect, cx, cy },
        lens: Lens::new(distortion, skew),
        camera_id: entry.camera_id,
        time: entry.time,
        described: (path, "orientation, position and intrinsics".into()),
    })
}

/// The mask of an image, if there is one: `mask/Nx/ID.png.png` of NeRF-DS (0 where something moves), or
/// `covisible/Nx/val/ID.png` of DyCheck (0 where no training camera sees the place). A mask of the image's own scale is
/// preferred.
fn find_mask(root: &Path, image: &Path, id: &str) -> Option<Mask> {
    let own = image.parent().and_then(Path::file_name).and_then(OsStr::to_str);
    own.into_iter().chain(SCALES).find_map(|scale| {
        let moving = ["png.png", "png"].map(|suffix| root.join("mask").join(scale).join(format!("{id}.{suffix}")));
        let unseen = root.join("covisible").join(scale).join("val").join(format!("{id}.png"));
        let found = |path: &Path, zero: MaskMeaning| files::find_image(path).map(|path| Mask { path, zero });
        let mask = moving.iter().find_map(|path| found(path, MaskMeaning::Moving));
        mask.or_else(|| found(&unseen, MaskMeaning::Ignored))
    })
}

/// The points that come with the capture, or random ones in front of the cameras.
fn points(root: &Path, splits: &SplitFrames, options: &LoadOptions) -> Result<PointCloud, DataError> {
    if let Some(cloud) = PointCloud::find(root)? {
        return Ok(cloud);
    }
    let path = root.join("points.npy");
    if !path.is_file() {
        return Ok(PointCloud::in_front_of(&splits.train, options));
    }
    let array = npy::read(&path, 3, "points, one [x, y, z] a row")?;
    let positions: Vec<[f32; 3]> = (0..array.rows)
        .map(|i| {
            let row = array.row(i);
            [row[0] as f32, row[1] as f32, row[2] as f32]
        })
        .collect();
    if let Some(i) = positions.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
        let problem = format!("{:?}, expected numbers that fit in 32 bits", array.row(i));
        return Err(DataError::field(&path, format!("[{i}]"), problem, "remove such points"));
    }
    let colors = vec![[0.5; 3]; positions.len()];
    Ok(PointCloud { positions, colors })
}
