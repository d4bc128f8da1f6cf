//! The cameras of a rig: each has a folder of frames, or a video.

use crate::error::DataError;
use crate::layouts::shared::files::{self, entries, images, name_of, natural, stem_of};
use crate::programs::ffmpeg::{Wanted, extract_frames};
use rayon::prelude::*;
use std::collections::{BTreeMap, hash_map::DefaultHasher};
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

/// Suffixes of videos, lower case.
const VIDEOS: [&str; 6] = ["mp4", "mov", "mkv", "avi", "webm", "m4v"];
/// Frames are extracted at the reference's width; the genuine videos are twice as wide.
const EXTRACTED_WIDTH: u32 = 1352;

/// A camera of the rig.
#[derive(Debug, PartialEq)]
pub(super) struct CameraFrames {
    /// Such as `cam07`.
    pub(super) name: String,
    /// The folder of its frames, if there is one.
    folder: Option<PathBuf>,
    /// The video from which its frames can be extracted, if there is one.
    video: Option<PathBuf>,
}

/// The cameras of a folder, in natural order of their names. If some are called `cam...`, other folders are no cameras.
pub(super) fn find(root: &Path) -> Result<Vec<CameraFrames>, DataError> {
    let mut cameras: BTreeMap<String, CameraFrames> = BTreeMap::new();
    for path in entries(root, |_| true)? {
        let folder = frame_folder(&path);
        let video = (files::has_suffix(&path, &VIDEOS) && path.is_file()).then(|| path.clone());
        if folder.is_none() && video.is_none() {
            continue;
        }
        let name = if video.is_some() { stem_of(&path) } else { name_of(&path) };
        let camera = cameras.entry(name.clone()).or_insert(CameraFrames { name, folder: None, video: None });
        camera.folder = folder.or(camera.folder.take());
        camera.video = video.or(camera.video.take());
    }
    let mut cameras: Vec<CameraFrames> = cameras.into_values().collect();
    let called_so = |camera: &CameraFrames| camera.name.to_ascii_lowercase().starts_with("cam");
    if cameras.iter().any(called_so) {
        cameras.retain(called_so);
    }
    cameras.sort_by(|a, b| natural(&a.name, &b.name));
    if cameras.is_empty() {
        return Err(DataError::field(
            root,
            "camXX",
            "no camera found, expected folders such as cam00/images, or videos such as cam00.mp4",
            "put the frames or the video of each camera there",
        ));
    }
    Ok(cameras)
}

/// `PATH/images` or `PATH` itself, if images lie there.
fn frame_folder(path: &Path) -> Option<PathBuf> {
    let candidates = [path.join("images"), path.to_path_buf()];
    candidates.into_iter().find(|folder| folder.is_dir() && images(folder).is_ok_and(|found| !found.is_empty()))
}

/// The row of the table for each camera. With as many rows as cameras, they are taken in order, since the genuine
/// captures number their rows consecutively though they leave out cameras. With more rows, the number in the camera's
/// name is the row, as after a bad camera has been removed.
pub(super) fn rows(table: &Path, cameras: &[CameraFrames], rows: usize) -> Result<Vec<usize>, DataError> {
    if cameras.len() == rows {
        return Ok((0..rows).collect());
    }
    let numbers: Option<Vec<usize>> = cameras.iter().map(|camera| number_of(&camera.name)).collect();
    if let Some(numbers) = numbers.filter(|numbers| numbers.iter().all(|number| *number < rows)) {
        return Ok(numbers);
    }
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    Err(DataError::field(
        table,
        "shape",
        format!("{rows} rows for {} cameras ({})", cameras.len(), names.join(", ")),
        "remove the rows of the cameras that are not there, or put them back",
    ))
}

fn number_of(name: &str) -> Option<usize> {
    let start =
        name.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + name[i..].chars().next().map_or(1, char::len_utf8));
    name[start..].parse().ok()
}

/// The frames of each camera with their frame numbers, counted from the first of the rig. Videos without frames are
/// extracted first: beside the video, or into the user's cache where the dataset cannot be written.
pub(super) fn frames(
    root: &Path,
    cameras: &[CameraFrames],
    length: Option<usize>,
    notes: &mut Vec<String>,
) -> Result<Vec<Vec<(usize, PathBuf)>>, DataError> {
    let folders = cameras.par_iter().map(|camera| extracted(root, camera, length)).collect::<Result<Vec<_>, _>>()?;
    let lists = folders.iter().map(|folder| images(folder)).collect::<Result<Vec<_>, _>>()?;
    // The number in a name is the frame number, so that a missing frame does not shift those after it.
    let numbers: Option<Vec<Vec<usize>>> =
        lists.iter().map(|list| list.iter().map(|path| number_of(&stem_of(path))).collect()).collect();
    let first = numbers.iter().flatten().flatten().min().copied().unwrap_or(0);
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    let span = numbers.iter().flatten().flatten().max().map_or(0, |last| last - first + 1);
    // Numbers in other names, such as times of day, do not count frames.
    let counted = numbers.filter(|_| span <= 2 * longest.max(1));
    let counts: Vec<usize> = lists.iter().map(Vec::len).collect();
    if let Some(shorter) = counts.iter().position(|count| *count < longest) {
        notes.push(format!(
            "cameras have different numbers of frames: {} has {}, others up to {longest}",
            cameras[shorter].name, counts[shorter]
        ));
    }
    let instants = |camera: usize, i: usize| counted.as_ref().map_or(i, |numbers| numbers[camera][i] - first);
    let with_instants = |(camera, list): (usize, Vec<PathBuf>)| {
        list.into_iter().enumerate().map(|(i, path)| (instants(camera, i), path)).collect()
    };
    Ok(lists.into_iter().enumerate().map(with_instants).collect())
}

/// The folder of a camera's frames; made from the video where there is none.
fn extracted(root: &Path, camera: &CameraFrames, length: Option<usize>) -> Result<PathBuf, DataError> {
    if let Some(folder) = &camera.folder {
        return Ok(folder.clone());
    }
    let Some(video) = &camera.video else {
        return Err(DataError::field(root, camera.name.clone(), "no frames and no video", "put one of them there"));
    };
    let wanted = Wanted { max_width: Some(EXTRACTED_WIDTH), count: length, ..Wanted::default() };
    // Beside the video, where the reference puts them too. A part of the sequence is not put there, since other
    // programs would take it for the whole.
    let beside = root.join(&camera.name).join("images");
    let metadata = root.metadata().map_err(DataError::io("read", root))?;
    if !metadata.permissions().readonly() && wanted.count.is_none() {
        match extract_frames(video, &beside, &wanted) {
            // The folder cannot be written.
            Err(DataError::Io { .. }) => {}
            done => return done.map(|()| beside),
        }
    }
    let folder = cache_folder(camera, video, &wanted)?;
    if !folder.is_dir() {
        extract_frames(video, &folder, &wanted)?;
    }
    Ok(folder)
}

/// A folder for the frames of this video, where the dataset is read-only.
fn cache_folder(camera: &CameraFrames, video: &Path, wanted: &Wanted) -> Result<PathBuf, DataError> {
    let metadata = video.metadata().map_err(DataError::io("read", video))?;
    let mut hasher = DefaultHasher::new();
    let place = video.canonicalize().map_err(DataError::io("read", video))?;
    (place, metadata.len(), metadata.modified().ok(), wanted.count).hash(&mut hasher);
    Ok(cache().join("frames").join(format!("{}-{:016x}", camera.name, hasher.finish())))
}

/// The user's cache: `LIGHT4GS_CACHE`, `XDG_CACHE_HOME/light4gs`, `HOME/.cache/light4gs`, or the folder for temporary
/// files.
fn cache() -> PathBuf {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    variable("LIGHT4GS_CACHE")
        .or_else(|| variable("XDG_CACHE_HOME").map(|folder| folder.join("light4gs")))
        .or_else(|| variable("HOME").map(|folder| folder.join(".cache/light4gs")))
        .unwrap_or_else(|| std::env::temp_dir().join("light4gs"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str]) -> Vec<CameraFrames> {
        names.iter().map(|name| CameraFrames { name: (*name).into(), folder: None, video: None }).collect()
    }

    #[test]
    fn rows_follow_the_order_or_the_numbers() {
        let table = Path::new("poses_bounds.npy");
        // Gaps in the names, and as many rows as cameras: in order.
        assert_eq!(rows(table, &named(&["cam00", "cam03", "cam20"]), 3).unwrap(), [0, 1, 2]);
        // A camera was removed: by number.
        assert_eq!(rows(table, &named(&["cam00", "cam02"]), 3).unwrap(), [0, 2]);
        let message = rows(table, &named(&["cam00", "cam20"]), 3).unwrap_err().to_string();
        assert!(message.contains("3 rows for 2 cameras (cam00, cam20)") && message.contains("; "), "{message}");
        assert!(rows(table, &named(&["a", "b"]), 1).is_err());
    }
}
