//! The D-NeRF layout: Blender transforms with a time for each frame.
//!
//! `transforms_{train,test,val}.json` hold `camera_angle_x` (radians) and `frames`, each with
//! `file_path` (with or without extension), `time` and `transform_matrix` (camera to world, OpenGL
//! axes). The first time of train and test becomes 0, the last one 1; a `val` time outside counts as the nearer one. `val`
//! may be absent. A `points3d.ply` or `fused.ply` beside the transforms gives the points, otherwise
//! they are random. `mask/` may have masks of what moves, for measuring: that of the image `test/r_003.png` is
//! `mask/test/r_003.png`, of the same size, 0 where nothing moves; a split has one for each of its images, or none.

use super::layout::DatasetLayout;
use super::shared::times::TimeRange;
use super::shared::{files, json, posed};
use crate::camera::{Camera, PoseError};
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};
use crate::images::read_headers;
use crate::options::LoadOptions;
use crate::orbit::orbit_path;
use crate::points::PointCloud;
use crate::scene::{Scene, SplitFrames};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Frames, distance to the origin (world units) and elevation (degrees) of the video path.
const VIDEO_PATH: (usize, f32, f32) = (160, 4.0, 30.0);

/// The layout `dnerf`: Blender transforms with a time for each frame, one file a split.
#[derive(Clone, Copy, Debug, Default)]
pub struct DNerf;

impl DatasetLayout for DNerf {
    fn name(&self) -> &'static str {
        "dnerf"
    }

    fn signature(&self) -> &'static str {
        "transforms_train.json"
    }

    fn detect(&self, root: &Path) -> bool {
        root.join(self.signature()).is_file()
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        let file = |split: &str| root.join(format!("transforms_{split}.json"));
        let train = read_split(root, file("train"))?;
        let test = read_split(root, file("test"))?;
        let val = if file("val").is_file() { Some(read_split(root, file("val"))?) } else { None };
        let times: Vec<f64> = train.frames.iter().chain(&test.frames).map(|frame| frame.time).collect();
        let range = TimeRange::of(&train.path, "frames[].time", &times)?;
        let frames = |split: &RawSplit| frames(root, split, range, options);
        let (train, test) = (frames(&train)?, frames(&test)?);
        let val = val.map_or(Ok(Vec::new()), |val| frames(&val))?;
        let video = video_path(&train[0].camera);
        let splits = SplitFrames { train, test, val, video };
        Scene::new(self.name(), root, splits, points(root, options)?, options.background)
    }
}

/// A camera that circles the scene once while time runs from 0 to 1.
fn video_path(intrinsics: &Camera) -> Vec<Frame> {
    let (count, radius, elevation) = VIDEO_PATH;
    let cameras = orbit_path(count, radius, elevation, intrinsics).into_iter().enumerate();
    cameras.map(|(i, (camera, time))| Frame::without_image(format!("v_{i:03}"), camera, time)).collect()
}

/// One entry of `frames`, with the time as in the file.
struct RawFrame {
    pose: [[f32; 4]; 4],
    time: f64,
    image: PathBuf,
}

/// One transforms file.
struct RawSplit {
    path: PathBuf,
    fov_x: f32,
    frames: Vec<RawFrame>,
}

/// The point cloud of the folder, or a random one.
fn points(root: &Path, options: &LoadOptions) -> Result<PointCloud, DataError> {
    let found = ["points3d.ply", "fused.ply"].iter().map(|name| root.join(name)).find(|path| path.is_file());
    match found {
        Some(path) => PointCloud::read_ply(&path),
        None => Ok(PointCloud::random(options.random_points, options.random_half_size, options.seed)),
    }
}

fn read_split(root: &Path, path: PathBuf) -> Result<RawSplit, DataError> {
    let document = json::read(&path)?;
    let fov_x = json::finite(
        &path,
        "camera_angle_x",
        document.get("camera_angle_x"),
        "the horizontal field of view in radians, between 0 and pi",
        "add the field to the file",
    )?;
    if !(fov_x > 0.0 && fov_x < std::f64::consts::PI) {
        return Err(DataError::field(
            &path,
            "camera_angle_x",
            format!("{fov_x}, expected the horizontal field of view in radians, between 0 and pi"),
            "convert degrees to radians, or export the file again",
        ));
    }
    let entries =
        document.get("frames").and_then(Value::as_array).filter(|entries| !entries.is_empty()).ok_or_else(|| {
            let found = json::describe(document.get("frames"));
            DataError::field(
                &path,
                "frames",
                format!("{found}, expected a list of at least one frame"),
                "every split needs a frame; only transforms_val.json may be left out altogether",
            )
        })?;
    let frames =
        entries.iter().enumerate().map(|(i, entry)| read_frame(root, &path, i, entry)).collect::<Result<_, _>>()?;
    Ok(RawSplit { path, fov_x: fov_x as f32, frames })
}

fn read_frame(root: &Path, path: &Path, i: usize, entry: &Value) -> Result<RawFrame, DataError> {
    let field = format!("frames[{i}].time");
    let expected = "a finite number of at least 0";
    let remedy = "give every frame its time (a static scene has 0 everywhere)";
    let time = json::finite(path, &field, entry.get("time"), expected, remedy)?;
    if time < 0.0 {
        let problem = format!("{time}, expected {expected}");
        return Err(DataError::field(path, field, problem, "shift the times so that the first is 0"));
    }
    Ok(RawFrame {
        pose: read_pose(path, i, entry.get("transform_matrix"))?,
        time,
        image: find_image(root, path, i, entry.get("file_path"))?,
    })
}

fn read_pose(path: &Path, i: usize, value: Option<&Value>) -> Result<[[f32; 4]; 4], DataError> {
    let field = format!("frames[{i}].transform_matrix");
    let remedy = "export the pose again as a 4x4 camera-to-world matrix";
    let wrong_shape =
        |what: String| DataError::field(path, field.clone(), format!("{what}, expected 4 rows of 4 numbers"), remedy);
    let rows = value
        .and_then(Value::as_array)
        .filter(|rows| rows.len() == 4)
        .ok_or_else(|| wrong_shape(json::describe(value)))?;
    let mut pose = [[0.0f32; 4]; 4];
    for (r, row) in rows.iter().enumerate() {
        let row = row
            .as_array()
            .filter(|row| row.len() == 4)
            .ok_or_else(|| wrong_shape(format!("row {r} is {}", json::describe(Some(row)))))?;
        for (c, value) in row.iter().enumerate() {
            let entry = format!("{field}[{r}][{c}]");
            pose[r][c] = json::finite(path, &entry, Some(value), "a finite number", remedy)? as f32;
        }
    }
    Ok(pose)
}

/// The image of a frame: `file_path` itself, or with an extension added.
fn find_image(root: &Path, path: &Path, i: usize, value: Option<&Value>) -> Result<PathBuf, DataError> {
    let name = value.and_then(Value::as_str).filter(|name| !name.is_empty()).ok_or_else(|| {
        let found = json::describe(value);
        DataError::field(
            path,
            format!("frames[{i}].file_path"),
            format!("{found}, expected the image's path, relative to the folder"),
            "add the field to the frame",
        )
    })?;
    let base = files::inside(root, path, &format!("frames[{i}].file_path"), name)?;
    files::find_image(&base).ok_or_else(|| {
        let tried = if files::is_image(&base) { base.clone() } else { with_suffix(&base) };
        DataError::image(
            &tried,
            format!("missing, but {} names it in frames[{i}].file_path", path.display()),
            "copy the image there or remove the frame",
        )
    })
}

/// The names of the layout's own images.
fn with_suffix(base: &Path) -> PathBuf {
    let mut name = base.as_os_str().to_owned();
    name.push(".png");
    name.into()
}

/// Frames with cameras at the wanted size and times in `[0, 1]`.
fn frames(root: &Path, split: &RawSplit, range: TimeRange, options: &LoadOptions) -> Result<Vec<Frame>, DataError> {
    let headers = read_headers(split.frames.par_iter().map(|frame| frame.image.as_path()).collect::<Vec<_>>())?;
    let Some(source) = headers.first().map(|header| header.size) else {
        return Ok(Vec::new());
    };
    // One field of view for the split means one size.
    if let Some(i) = headers.iter().position(|header| header.size != source) {
        let (found, expected) = (headers[i].size, source);
        return Err(DataError::image(
            &split.frames[i].image,
            format!(
                "it is {} x {} pixels, expected {} x {} as the first image of its split",
                found.0, found.1, expected.0, expected.1
            ),
            "make all images of a split the same size",
        ));
    }
    let (width, height) = posed::used_size(&split.frames[0].image, source, options)?;
    let masks = find_masks(root, split, source)?;
    let to_frame = |((i, raw), mask): ((usize, &RawFrame), Option<Mask>)| {
        let camera = Camera::from_camera_to_world_opengl(&raw.pose, split.fov_x, source.0, source.1)
            .map_err(|error| pose_error(&split.path, i, error))?;
        let name = raw.image.file_stem().map_or_else(|| i.to_string(), |stem| stem.to_string_lossy().into_owned());
        let frame =
            Frame::new(name, camera.resized(width, height), range.at(raw.time) as f32, raw.image.clone(), source);
        Ok(Frame { mask, ..frame })
    };
    split.frames.iter().enumerate().zip(masks).map(to_frame).collect()
}

/// The masks of a split's images, which are `source` = (width, height) pixels large. All of them, or none: figures over
/// a part of the views could be taken for figures over all.
fn find_masks(root: &Path, split: &RawSplit, source: (u32, u32)) -> Result<Vec<Option<Mask>>, DataError> {
    let folder = root.join("mask");
    let expected = |raw: &RawFrame| folder.join(raw.image.strip_prefix(root).unwrap_or(&raw.image));
    let paths: Vec<Option<PathBuf>> = split.frames.iter().map(|raw| files::find_image(&expected(raw))).collect();
    let found: Vec<&Path> = paths.iter().flatten().map(PathBuf::as_path).collect();
    if found.is_empty() {
        return Ok(vec![None; paths.len()]);
    }
    if let Some((raw, _)) = split.frames.iter().zip(&paths).find(|(_, path)| path.is_none()) {
        return Err(DataError::image(
            &expected(raw),
            format!("this mask is missing, but {} of the {} images of its split have one", found.len(), paths.len()),
            "copy it there, or remove the split's masks",
        ));
    }
    for (path, header) in found.iter().zip(read_headers(found.clone())?) {
        if header.size != source {
            let (width, height) = header.size;
            let problem = format!("the mask is {width} x {height} pixels, its image {} x {}", source.0, source.1);
            return Err(DataError::image(path, problem, "make masks of the images as they are"));
        }
    }
    Ok(paths.into_iter().map(|path| path.map(|path| Mask { path, zero: MaskMeaning::Still })).collect())
}

fn pose_error(path: &Path, i: usize, error: PoseError) -> DataError {
    let (field, remedy) = match error {
        PoseError::FieldOfView { .. } => {
            ("camera_angle_x".to_string(), "give the angle in radians, large enough for a 32-bit number")
        }
        _ => (
            format!("frames[{i}].transform_matrix"),
            "export the pose again as a 4x4 camera-to-world matrix without scaling or mirroring",
        ),
    };
    DataError::field(path, field, error.to_string(), remedy)
}
