//! The layout of nerfstudio and instant-ngp: `transforms.json` with intrinsics, shared or of each frame.
//!
//! `transform_matrix` is camera to world in OpenGL axes. `camera_model` says to which lens `k1 k2 k3 k4 p1 p2` belong.
//! `time` of a frame is optional; without it the time comes from the images' names, see [`places`]. `train_filenames`,
//! `val_filenames` and `test_filenames` are the splits, if they are there. `light4gs prepare` writes this layout, too.

use super::colmap::{frame_name, split};
use super::layout::DatasetLayout;
use super::shared::posed::{self, PosedImage};
use super::shared::sequence::{Place, held_out, places};
use super::shared::times::TimeRange;
use super::shared::{files, json};
use crate::camera::Intrinsics;
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};
use crate::images::image_size;
use crate::lens::{Distortion, Lens};
use crate::options::LoadOptions;
use crate::points::PointCloud;
use crate::scene::{Scene, SplitFrames};
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// The remedy for a malformed field.
const REMEDY: &str = "export the capture again, or correct the field";
/// Camera models that are no fisheyes: their distortion is a function of `x / z` and `y / z`, not of the angle.
const PINHOLES: [&str; 7] =
    ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV", "PERSPECTIVE"];

/// The layout `nerfstudio`: one `transforms.json` with intrinsics.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nerfstudio;

impl DatasetLayout for Nerfstudio {
    fn name(&self) -> &'static str {
        "nerfstudio"
    }

    fn signature(&self) -> &'static str {
        "transforms.json"
    }

    fn detect(&self, root: &Path) -> bool {
        root.join(self.signature()).is_file()
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        let file = File { root, path: root.join(self.signature()) };
        let document = json::read(&file.path)?;
        let entries = document.get("frames").and_then(Value::as_array).filter(|list| !list.is_empty());
        let entries = entries.ok_or_else(|| {
            let found = json::describe(document.get("frames"));
            DataError::field(&file.path, "frames", format!("{found}, expected a list of at least one frame"), REMEDY)
        })?;
        let mut notes = Vec::new();
        let named: Vec<(usize, PathBuf)> =
            (0..entries.len()).map(|i| Ok((i, file.image_of(i, &entries[i])?))).collect::<Result<_, DataError>>()?;
        let present =
            posed::present(&file.path, named, &mut notes, |(_, path)| (path.clone(), files::find_image(path)))?;
        let relative: Vec<String> = present
            .iter()
            .map(|((_, _), path)| path.strip_prefix(root).unwrap_or(path).to_string_lossy().into_owned())
            .collect();
        let places = file.places(entries, &present, &relative)?;
        let mut images = Vec::with_capacity(present.len());
        let names = frame_names(&relative);
        for ((((i, _), path), place), name) in present.iter().zip(&places).zip(names) {
            images.push(PosedImage { name, ..file.image(&document, *i, &entries[*i], path, place)? });
        }
        if entries.iter().any(|entry| entry.get("mask_path").is_some_and(|path| !path.is_null())) {
            posed::note_unmasked(&images, &mut notes);
        }
        let frames = posed::frames(&images, options)?;
        let splits = file.splits(&document, frames, &held_out(&places))?;
        let points = file.points(&document, &splits, options)?;
        let mut scene = Scene::new(self.name(), root, splits, points, options.background)?;
        scene.notes = notes;
        Ok(scene)
    }
}

/// Names for frames, from their images' paths: the last part, with the folder before it where the last part is not
/// unique.
fn frame_names(paths: &[String]) -> Vec<String> {
    let last = |count: usize| -> Vec<String> {
        let of = |path: &String| {
            let parts: Vec<&str> = path.split(['/', '\\']).collect();
            frame_name(&parts[parts.len().saturating_sub(count)..].join("/"))
        };
        paths.iter().map(of).collect()
    };
    let short = last(1);
    let unique: HashSet<&String> = short.iter().collect();
    if unique.len() == short.len() { short } else { last(2) }
}

/// The transforms file and the folder that its paths are relative to.
struct File<'a> {
    root: &'a Path,
    path: PathBuf,
}

/// An image that exists: its number in `frames`, the path that the file names, and the path that it has.
type Present = ((usize, PathBuf), PathBuf);

impl File<'_> {
    fn image_of(&self, i: usize, entry: &Value) -> Result<PathBuf, DataError> {
        let field = format!("frames[{i}].file_path");
        let name = entry.get("file_path").and_then(Value::as_str).filter(|name| !name.is_empty()).ok_or_else(|| {
            let found = json::describe(entry.get("file_path"));
            DataError::field(&self.path, &field, format!("{found}, expected the image's path"), REMEDY)
        })?;
        files::inside(self.root, &self.path, &field, name)
    }

    /// Cameras and times: from `time` if every frame has one, otherwise from the names.
    fn places(&self, entries: &[Value], present: &[Present], names: &[String]) -> Result<Vec<Place>, DataError> {
        let mut found = places(names);
        let timed = present.iter().filter(|((i, _), _)| entries[*i].get("time").is_some()).count();
        if timed == 0 {
            return Ok(found);
        }
        let mut times = Vec::with_capacity(present.len());
        for ((i, _), _) in present {
            let field = format!("frames[{i}].time");
            let expected = "a finite number, as the other frames have";
            times.push(json::finite(&self.path, &field, entries[*i].get("time"), expected, REMEDY)?);
        }
        // Times in [0, 1] stay as they are; others are mapped to that range.
        let range = TimeRange::of(&self.path, "frames[].time", &times)?;
        let stay = times.iter().all(|time| (0.0..=1.0).contains(time));
        for (place, time) in found.iter_mut().zip(times) {
            place.time = if stay { time } else { range.at(time) };
        }
        Ok(found)
    }

    fn image(
        &self,
        document: &Value,
        i: usize,
        entry: &Value,
        path: &Path,
        place: &Place,
    ) -> Result<PosedImage, DataError> {
        let field = format!("frames[{i}].transform_matrix");
        let rows = json::rows::<3, 4>(&self.path, &field, entry.get("transform_matrix"), REMEDY)?;
        let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
        let (intrinsics, lens) = self.camera(document, i, entry, path)?;
        let mask = match entry.get("mask_path").and_then(Value::as_str) {
            None => None,
            Some(name) => {
                let path = files::inside(self.root, &self.path, &format!("frames[{i}].mask_path"), name)?;
                files::find_image(&path).map(|path| Mask { path, zero: MaskMeaning::Ignored })
            }
        };
        Ok(PosedImage {
            name: files::stem_of(path),
            path: path.to_path_buf(),
            mask,
            // OpenGL -> OpenCV: y and z change sign. The inverse of a rotation is its transpose.
            rotation: DMat3::from_cols(column(0), -column(1), -column(2)).transpose(),
            center: column(3),
            intrinsics,
            lens,
            camera_id: place.camera,
            time: place.time,
            described: (self.path.clone(), field),
        })
    }

    /// Intrinsics and lens of a frame. Fields that the frame lacks are taken from the top of the file.
    fn camera(
        &self,
        document: &Value,
        i: usize,
        entry: &Value,
        image: &Path,
    ) -> Result<(Intrinsics, Option<Lens>), DataError> {
        let value = |key: &str| match entry.get(key) {
            Some(value) => (format!("frames[{i}].{key}"), Some(value)),
            None => (key.to_owned(), document.get(key)),
        };
        let number = |key: &str| -> Result<Option<f64>, DataError> {
            let (field, value) = value(key);
            value.map(|value| json::finite(&self.path, &field, Some(value), "a finite number", REMEDY)).transpose()
        };
        let size = match (number("w")?, number("h")?) {
            (Some(width), Some(height)) => (width, height),
            _ => {
                let (width, height) = image_size(image)?;
                (f64::from(width), f64::from(height))
            }
        };
        let (width, height) = size;
        if !(width >= 1.0 && height >= 1.0 && width <= 65_535.0 && height <= 65_535.0) {
            let problem = format!("{width} x {height}, expected 1 to 65535 pixels on each side");
            return Err(DataError::field(&self.path, value("w").0, problem, REMEDY));
        }
        let from_angle = |key: &str, side: f64| -> Result<Option<f64>, DataError> {
            let Some(angle) = number(key)? else { return Ok(None) };
            if !(angle > 0.0 && angle < std::f64::consts::PI) {
                let problem = format!("{angle}, expected an angle in radians, between 0 and pi");
                return Err(DataError::field(&self.path, value(key).0, problem, REMEDY));
            }
            Ok(Some(side / (2.0 * (angle / 2.0).tan())))
        };
        let across = number("fl_x")?.map_or_else(|| from_angle("camera_angle_x", width), |f| Ok(Some(f)))?;
        let down = number("fl_y")?.map_or_else(|| from_angle("camera_angle_y", height), |f| Ok(Some(f)))?;
        let Some(fx) = across.or(down) else {
            let problem = "missing, expected fl_x (pixels) or camera_angle_x (radians)";
            return Err(DataError::field(&self.path, value("fl_x").0, problem, REMEDY));
        };
        let fy = down.unwrap_or(fx);
        if !(fx > 0.0 && fy > 0.0) {
            let problem = format!("focal lengths are {fx} x {fy}, expected positive numbers of pixels");
            return Err(DataError::field(&self.path, value(if fx > 0.0 { "fl_y" } else { "fl_x" }).0, problem, REMEDY));
        }
        let (cx, cy) = (number("cx")?.unwrap_or(width / 2.0), number("cy")?.unwrap_or(height / 2.0));
        let intrinsics = Intrinsics { width: width as u32, height: height as u32, fx, fy, cx, cy };
        let mut k = [0.0; 6];
        for (i, key) in ["k1", "k2", "k3", "k4", "k5", "k6"].into_iter().enumerate() {
            k[i] = number(key)?.unwrap_or(0.0);
        }
        let tangential = [number("p1")?.unwrap_or(0.0), number("p2")?.unwrap_or(0.0)];
        let (field, model) = value("camera_model");
        let model = model.filter(|model| !model.is_null());
        // nerfstudio's `k4` is the next term of the polynomial. OpenCV's is in the denominator, in a model that always
        // has `k5` and `k6`.
        let divides = k[4] != 0.0 || k[5] != 0.0 || model.is_some_and(|model| model == "FULL_OPENCV");
        let perspective = if divides || k[3] == 0.0 {
            Distortion::RadialTangential { radial: k, tangential }
        } else {
            Distortion::BrownConrady { radial: [k[0], k[1], k[2], k[3]], tangential }
        };
        let fisheye = matches!(entry.get("is_fisheye").or(document.get("is_fisheye")), Some(Value::Bool(true)));
        let distortion = match model.map(|model| model.as_str().unwrap_or("")) {
            None if !fisheye => perspective,
            Some(name) if PINHOLES.contains(&name) => perspective,
            None | Some("OPENCV_FISHEYE") => Distortion::Fisheye { radial: [k[0], k[1], k[2], k[3]] },
            Some(_) => {
                let found = json::describe(model);
                let known = PINHOLES.join(", ");
                return Err(DataError::field(
                    &self.path,
                    field,
                    format!("{found} is not known, expected {known} or OPENCV_FISHEYE"),
                    "undistort the images first; panoramas must be cut into perspective views",
                ));
            }
        };
        Ok((intrinsics, Lens::new(distortion, 0.0)))
    }

    /// The splits that the file names, or those by `tests`.
    fn splits(&self, document: &Value, frames: Vec<Frame>, tests: &[bool]) -> Result<SplitFrames, DataError> {
        let mut named: HashMap<PathBuf, &str> = HashMap::new();
        let paths: HashSet<PathBuf> = frames.iter().map(|frame| frame.path.clone()).collect();
        for split in ["train", "val", "test"] {
            let field = format!("{split}_filenames");
            let Some(list) = document.get(&field) else { continue };
            let names = json::words(&self.path, &field, Some(list), REMEDY)?;
            let mut known = names.is_empty();
            for (i, name) in names.iter().enumerate() {
                let path = files::inside(self.root, &self.path, &format!("{field}[{i}]"), name)?;
                let path = files::find_image(&path).unwrap_or(path);
                known |= paths.contains(&path);
                named.insert(path, split);
            }
            // Some names may be missing. If all are, they are not those of this capture.
            if !known {
                let found = files::shorten(&names[0]);
                let problem = format!("none of its {} names is that of a frame; the first is `{found}`", names.len());
                return Err(DataError::field(&self.path, field, problem, "write them as in `file_path` of the frames"));
            }
        }
        if !named.values().any(|split| *split != "train") {
            return Ok(split(frames, tests));
        }
        let of = |frame: &Frame| named.get(&frame.path).copied();
        // nerfstudio itself measures on `val` where there is no `test`.
        let judged = if named.values().any(|split| *split == "test") { "test" } else { "val" };
        let (val, rest): (Vec<Frame>, Vec<Frame>) = frames
            .into_iter()
            .filter(|frame| of(frame).is_some())
            .partition(|f| of(f) == Some("val") && judged != "val");
        let tests: Vec<bool> = rest.iter().map(|frame| of(frame) == Some(judged)).collect();
        Ok(SplitFrames { val, ..split(rest, &tests) })
    }

    fn points(&self, document: &Value, splits: &SplitFrames, options: &LoadOptions) -> Result<PointCloud, DataError> {
        if let Some(name) = document.get("ply_file_path").and_then(Value::as_str) {
            let path = files::inside(self.root, &self.path, "ply_file_path", name)?;
            if path.is_file() {
                return PointCloud::read_ply(&path);
            }
        }
        Ok(PointCloud::find(self.root)?.unwrap_or_else(|| PointCloud::in_front_of(&splits.train, options)))
    }
}
