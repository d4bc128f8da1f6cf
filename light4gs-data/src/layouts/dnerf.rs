//! The D-NeRF layout: Blender transforms with a time for each frame.
//!
//! `transforms_{train,test,val}.json` hold `frames`, each with `file_path` (with or without extension), `time`,
//! `transform_matrix`, and intrinsics: `camera_angle_x` (radians), or any that [`Transforms`] knows. The first time of
//! train and test becomes 0, the last one 1; a `val` time outside counts as the nearer one. `val` may be absent. A
//! `points3d.ply` or `fused.ply` beside the transforms gives the points, otherwise they are random. `mask/` may have masks
//! of what moves, for measuring: that of the image `test/r_003.png` is `mask/test/r_003.png`, of the same size, 0 where
//! nothing moves; a split has one for each of its images, or none.

use super::layout::DatasetLayout;
use super::shared::posed::{self, PosedImage};
use super::shared::times::TimeRange;
use super::shared::transforms::Transforms;
use super::shared::{files, json};
use crate::camera::Camera;
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};
use crate::images::read_headers;
use crate::options::LoadOptions;
use crate::orbit::orbit_path;
use crate::points::PointCloud;
use crate::scene::{Reading, Scene, SplitFrames};
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Frames, distance to the origin (world units) and elevation (degrees) of the video path.
const VIDEO_PATH: (usize, f32, f32) = (160, 4.0, 30.0);

/// The layout `dnerf`: Blender transforms with a time for each frame, one file per split.
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
        let mut notes = Vec::new();
        let train = Split::read(root, file("train"), &mut notes)?;
        let test = Split::read(root, file("test"), &mut notes)?;
        let val = if file("val").is_file() { Some(Split::read(root, file("val"), &mut notes)?) } else { None };
        let times: Vec<f64> = train.frames.iter().chain(&test.frames).map(|frame| frame.time).collect();
        let range = TimeRange::of(&train.file.path, "frames[].time", &times)?;
        [Some(&test), val.as_ref()].into_iter().flatten().try_for_each(|split| split.check_unit(&train))?;
        let mut frames = |split: &Split| split.frames(range, options, &mut notes);
        let (train, test) = (frames(&train)?, frames(&test)?);
        let val = val.map_or(Ok(Vec::new()), |val| frames(&val))?;
        let video = video_path(&train[0].camera);
        let splits = SplitFrames { train, test, val, video };
        let reading = Reading { times: format!("frames[].time, {range} mapped to 0 to 1"), ..Reading::default() };
        let scene = Scene::new(self.name(), root, splits, points(root, options)?, options.background)?;
        Ok(scene.with_notes(notes).with_reading(reading))
    }
}

/// A camera that circles the scene once while time runs from 0 to 1.
fn video_path(intrinsics: &Camera) -> Vec<Frame> {
    let (count, radius, elevation) = VIDEO_PATH;
    let cameras = orbit_path(count, radius, elevation, intrinsics).into_iter().enumerate();
    cameras.map(|(i, (camera, time))| Frame::without_image(format!("v_{i:03}"), camera, time)).collect()
}

/// The point cloud of the folder, or a random one.
fn points(root: &Path, options: &LoadOptions) -> Result<PointCloud, DataError> {
    let found = ["points3d.ply", "fused.ply"].iter().map(|name| root.join(name)).find(|path| path.is_file());
    match found {
        Some(path) => PointCloud::read_ply(&path),
        None => Ok(PointCloud::random(
            options.random_points.min(options.most_points),
            options.random_half_size,
            options.seed,
        )),
    }
}

/// Splits with so many different times can be compared, and those that last longer by this factor have another unit.
const LEAST_TIMES: usize = 3;
const UNITS: f64 = 300.0;

/// One entry of `frames`.
struct RawFrame {
    /// Its place in `frames`.
    index: usize,
    /// As in the file.
    time: f64,
    image: PathBuf,
}

/// One transforms file.
struct Split {
    file: Transforms,
    frames: Vec<RawFrame>,
}

impl Split {
    /// The different times, rising.
    fn times(&self) -> Vec<f64> {
        let mut times: Vec<f64> = self.frames.iter().map(|frame| frame.time).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Refuses times that last so much longer or shorter than those of another split that they are in another unit.
    fn check_unit(&self, other: &Self) -> Result<(), DataError> {
        let [own, others] = [self, other].map(Self::times);
        let span = |times: &[f64]| times[times.len() - 1] - times[0];
        if own.len() < LEAST_TIMES || others.len() < LEAST_TIMES {
            return Ok(());
        }
        let factor = span(&own) / span(&others);
        if (1.0 / UNITS..UNITS).contains(&factor) {
            return Ok(());
        }
        let [from, to, first, last] = [own[0], own[own.len() - 1], others[0], others[others.len() - 1]];
        let problem =
            format!("times run from {from} to {to}, those of {} from {first} to {last}", other.file.path.display());
        Err(DataError::field(&self.file.path, "frames[].time", problem, "give the times of all splits in one unit"))
    }

    fn read(root: &Path, path: PathBuf, notes: &mut Vec<String>) -> Result<Self, DataError> {
        let file = Transforms::read(root, path)?;
        let mut frames = Vec::with_capacity(file.frames.len());
        let mut known = HashSet::new();
        for index in 0..file.frames.len() {
            let (time, image) = (read_time(&file, index)?, find_image(&file, index)?);
            if known.insert((image.clone(), time.to_bits())) {
                frames.push(RawFrame { index, time, image });
            }
        }
        if frames.len() < file.frames.len() {
            let (copies, file) = (file.frames.len() - frames.len(), file.path.display());
            notes.push(format!("{copies} entries of {file} are there for the second time and are left out"));
        }
        Ok(Self { file, frames })
    }

    /// Frames with cameras at the wanted size and times in `[0, 1]`.
    fn frames(
        &self,
        range: TimeRange,
        options: &LoadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Vec<Frame>, DataError> {
        let headers = read_headers(self.frames.par_iter().map(|frame| frame.image.as_path()).collect::<Vec<_>>())?;
        let Some(source) = headers.first().map(|header| header.size) else {
            return Ok(Vec::new());
        };
        // One field of view for the split means one size, unless the file says another.
        let other = self
            .frames
            .iter()
            .zip(&headers)
            .find(|(frame, header)| header.size != source && !self.file.gives_size(frame.index));
        if let Some((frame, header)) = other {
            let ((width, height), (expected_width, expected_height)) = (header.size, source);
            let problem = format!(
                "it is {width} x {height} pixels, expected {expected_width} x {expected_height} as the first image of its split"
            );
            return Err(DataError::image(&frame.image, problem, "make all images of a split the same size"));
        }
        let sizes = headers.iter().map(|header| header.size);
        let masks = self.masks(&sizes.collect::<Vec<_>>())?;
        let image = |(raw, mask): (&RawFrame, Option<Mask>)| {
            let (rotation, center) = self.file.pose(raw.index)?;
            let (intrinsics, lens) = self.file.camera(raw.index, &raw.image)?;
            Ok(PosedImage {
                name: raw.image.file_stem().map_or_else(|| raw.index.to_string(), |stem| stem.to_string_lossy().into()),
                path: raw.image.clone(),
                mask,
                // Blender's numbers are 32 bits wide. The figures in docs/results.md were made with them as such.
                rotation: rotation.as_mat3().as_dmat3(),
                center: center.as_vec3().as_dvec3(),
                intrinsics,
                lens,
                camera_id: 0,
                time: range.at(raw.time),
                described: (self.file.path.clone(), Transforms::pose_field(raw.index)),
            })
        };
        let images: Vec<PosedImage> = self.frames.iter().zip(masks).map(image).collect::<Result<_, DataError>>()?;
        posed::frames(&images, options, notes)
    }

    /// The masks of the images, which have these sizes. All of them, or none: figures over a part of the views could be
    /// taken for figures over all.
    fn masks(&self, sizes: &[(u32, u32)]) -> Result<Vec<Option<Mask>>, DataError> {
        let root = &self.file.root;
        let expected = |raw: &RawFrame| root.join("mask").join(raw.image.strip_prefix(root).unwrap_or(&raw.image));
        let paths: Vec<Option<PathBuf>> = self.frames.iter().map(|raw| files::find_image(&expected(raw))).collect();
        let found: Vec<&Path> = paths.iter().flatten().map(PathBuf::as_path).collect();
        if found.is_empty() {
            return Ok(vec![None; paths.len()]);
        }
        if let Some((raw, _)) = self.frames.iter().zip(&paths).find(|(_, path)| path.is_none()) {
            return Err(DataError::image(
                &expected(raw),
                format!(
                    "this mask is missing, but {} of the {} images of its split have one",
                    found.len(),
                    paths.len()
                ),
                "copy it there, or remove the split's masks",
            ));
        }
        for ((path, header), size) in found.iter().zip(read_headers(found.clone())?).zip(sizes) {
            if header.size != *size {
                let (width, height) = header.size;
                let problem = format!("the mask is {width} x {height} pixels, its image {} x {}", size.0, size.1);
                return Err(DataError::image(path, problem, "make masks of the images as they are"));
            }
        }
        Ok(paths.into_iter().map(|path| path.map(|path| Mask { path, zero: MaskMeaning::Still })).collect())
    }
}

fn read_time(file: &Transforms, i: usize) -> Result<f64, DataError> {
    let field = format!("frames[{i}].time");
    let remedy = "give every frame its time (a static scene has 0 everywhere)";
    json::finite(&file.path, &field, file.frames[i].get("time"), "a finite number", remedy)
}

/// The image of a frame: `file_path` itself, or with an extension added.
fn find_image(file: &Transforms, i: usize) -> Result<PathBuf, DataError> {
    let base = file.image(i)?;
    files::find_image(&base).ok_or_else(|| {
        let tried = if files::is_image(&base) { base.clone() } else { with_suffix(&base) };
        DataError::image(
            &tried,
            format!("missing, but {} names it in frames[{i}].file_path", file.path.display()),
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
