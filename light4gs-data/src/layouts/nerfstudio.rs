//! The layout of nerfstudio and instant-ngp: `transforms.json` with intrinsics, shared or of each frame.
//!
//! The fields of a frame are those of [`Transforms`].
//! `time` of a frame is optional; without it the time comes from the images' names, see [`sequence`]. `train_filenames`,
//! `val_filenames` and `test_filenames` are the splits, if they are there. `fps` or `seconds` say how long the capture lasts, see
//! [`seconds_of`]. `light4gs prepare` writes this layout, too.

use super::colmap::{frame_name, split};
use super::layout::DatasetLayout;
use super::shared::posed::{self, PosedImage};
use super::shared::seconds::seconds_of;
use super::shared::sequence::{Place, Sequence, held_out, sequence};
use super::shared::times::TimeRange;
use super::shared::transforms::{REMEDY, Transforms};
use super::shared::{files, json};
use crate::error::DataError;
use crate::frame::{Frame, Mask, MaskMeaning};
use crate::options::LoadOptions;
use crate::points::PointCloud;
use crate::scene::{Scene, SplitFrames};
use serde_json::Value;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

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
        let file = Transforms::read(root, root.join(self.signature()))?;
        let mut notes = Vec::new();
        let named: Vec<(usize, PathBuf)> =
            (0..file.frames.len()).map(|i| Ok((i, file.image(i)?))).collect::<Result<_, DataError>>()?;
        let present =
            posed::present(&file.path, named, &mut notes, |(_, path)| (path.clone(), files::find_image(path)))?;
        let relative: Vec<String> = present
            .iter()
            .map(|(_, path)| path.strip_prefix(root).unwrap_or(path).to_string_lossy().into_owned())
            .collect();
        let mut found = sequence(&relative, options);
        let times = given_times(&file, &present)?;
        let seconds = seconds_of(&file.path, &file.document, times.as_deref(), &found, &mut notes);
        if let Some(times) = times {
            take_times(&mut found, &file, times)?;
        }
        let Sequence { places, mut reading, .. } = found;
        let mut images = Vec::with_capacity(present.len());
        for ((((i, _), path), place), name) in present.iter().zip(&places).zip(frame_names(&relative)) {
            images.push(image(&file, *i, name, path, place)?);
        }
        if file.frames.iter().any(|entry| entry.get("mask_path").is_some_and(|path| !path.is_null())) {
            posed::note_unmasked(&images, &mut notes);
        }
        reading.unposed = posed::note_unposed(root, &images, &mut notes);
        let frames = posed::frames(&images, options, &mut notes)?;
        let splits = splits(&file, frames, &held_out(&places), &mut notes)?;
        let points = points(&file, &splits, options, &mut notes)?;
        let scene = Scene::new(self.name(), root, splits, points, options.background)?;
        Ok(scene.with_notes(notes).with_reading(reading).with_seconds(seconds))
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

/// An image that exists: its number in `frames`, the path that the file names, and the path that it has.
type Present = ((usize, PathBuf), PathBuf);

/// `time` of each frame in the unit of the file; `None` where no frame has one.
fn given_times(file: &Transforms, present: &[Present]) -> Result<Option<Vec<f64>>, DataError> {
    let timed = present.iter().filter(|((i, _), _)| file.frames[*i].get("time").is_some()).count();
    if timed == 0 {
        return Ok(None);
    }
    let mut times = Vec::with_capacity(present.len());
    for ((i, _), _) in present {
        let field = format!("frames[{i}].time");
        let expected = "a finite number, as the other frames have";
        times.push(json::finite(&file.path, &field, file.frames[*i].get("time"), expected, REMEDY)?);
    }
    Ok(Some(times))
}

/// Puts the times of the file in the place of those of the names. Times in [0, 1] stay as they are; others are mapped to that
/// range.
fn take_times(found: &mut Sequence, file: &Transforms, times: Vec<f64>) -> Result<(), DataError> {
    let range = TimeRange::of(&file.path, "frames[].time", &times)?;
    let stay = times.iter().all(|time| (0.0..=1.0).contains(time));
    found.reading.times =
        if stay { format!("frames[].time, {range}") } else { format!("frames[].time, {range} mapped to 0 to 1") };
    for (place, time) in found.places.iter_mut().zip(times) {
        place.time = if stay { time } else { range.at(time) };
    }
    Ok(())
}

fn image(file: &Transforms, i: usize, name: String, path: &Path, place: &Place) -> Result<PosedImage, DataError> {
    let (rotation, center) = file.pose(i)?;
    let (intrinsics, lens) = file.camera(i, path)?;
    let mask = match file.frames[i].get("mask_path").and_then(Value::as_str) {
        None => None,
        Some(name) => {
            let path = files::inside(&file.root, &file.path, &format!("frames[{i}].mask_path"), name)?;
            files::find_image(&path).map(|path| Mask { path, zero: MaskMeaning::Ignored })
        }
    };
    Ok(PosedImage {
        name,
        path: path.to_path_buf(),
        mask,
        rotation,
        center,
        intrinsics,
        lens,
        camera_id: place.camera,
        time: place.time,
        described: (file.path.clone(), Transforms::pose_field(i)),
    })
}

/// The splits that the file names, or those by `tests`.
fn splits(
    file: &Transforms,
    frames: Vec<Frame>,
    tests: &[bool],
    notes: &mut Vec<String>,
) -> Result<SplitFrames, DataError> {
    let mut named: HashMap<PathBuf, &str> = HashMap::new();
    let paths: HashSet<PathBuf> = frames.iter().map(|frame| frame.path.clone()).collect();
    for split in ["train", "val", "test"] {
        let field = format!("{split}_filenames");
        let Some(list) = file.document.get(&field) else { continue };
        let names = json::words(&file.path, &field, Some(list), REMEDY)?;
        let mut known = names.is_empty();
        for (i, name) in names.iter().enumerate() {
            let path = files::inside(&file.root, &file.path, &format!("{field}[{i}]"), name)?;
            let path = files::find_image(&path).unwrap_or(path);
            known |= paths.contains(&path);
            named.insert(path, split);
        }
        // Some names may be missing. If all are, they are not those of this capture.
        if !known {
            let found = files::shorten(&names[0]);
            let problem = format!("none of its {} names is that of a frame; the first is `{found}`", names.len());
            return Err(DataError::field(&file.path, field, problem, "write them as in `file_path` of the frames"));
        }
    }
    if !named.values().any(|split| *split != "train") {
        if !named.is_empty() {
            let held_out = tests.iter().filter(|test| **test).count();
            notes.push(format!(
                "{} names no image to measure on: {held_out} of its {} images are held out from training",
                file.path.display(),
                tests.len()
            ));
        }
        return Ok(split(frames, tests));
    }
    let of = |frame: &Frame| named.get(&frame.path).copied();
    // nerfstudio itself measures on `val` where there is no `test`.
    let judged = if named.values().any(|split| *split == "test") { "test" } else { "val" };
    let (val, rest): (Vec<Frame>, Vec<Frame>) =
        frames.into_iter().filter(|frame| of(frame).is_some()).partition(|f| of(f) == Some("val") && judged != "val");
    let tests: Vec<bool> = rest.iter().map(|frame| of(frame) == Some(judged)).collect();
    Ok(SplitFrames { val, ..split(rest, &tests) })
}

fn points(
    file: &Transforms,
    splits: &SplitFrames,
    options: &LoadOptions,
    notes: &mut Vec<String>,
) -> Result<PointCloud, DataError> {
    if let Some(name) = file.document.get("ply_file_path").and_then(Value::as_str) {
        let path = files::inside(&file.root, &file.path, "ply_file_path", name)?;
        if path.is_file() {
            return PointCloud::read_ply(&path);
        }
        notes.push(format!("{}, which ply_file_path names, is missing: other points are taken", path.display()));
    }
    Ok(PointCloud::find(&file.root)?.unwrap_or_else(|| PointCloud::in_front_of(&splits.train, options)))
}
