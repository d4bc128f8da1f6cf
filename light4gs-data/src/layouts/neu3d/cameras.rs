//! The cameras of a rig: each has a folder of frames, or a video.

use crate::error::DataError;
use crate::layouts::shared::files::{self, entries, images, name_of, natural, stem_of};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Suffixes of videos, lower case.
const VIDEOS: [&str; 6] = ["mp4", "mov", "mkv", "avi", "webm", "m4v"];

/// A camera of the rig.
#[derive(Debug, PartialEq)]
pub(super) struct CameraFrames {
    /// Such as `cam07`.
    pub(super) name: String,
    /// The folder of its frames, if there is one.
    pub(super) folder: Option<PathBuf>,
    /// The video from which its frames can be extracted, if there is one.
    pub(super) video: Option<PathBuf>,
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
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    let problem = format!("{rows} rows for {} cameras ({})", cameras.len(), names.join(", "));
    if cameras.len() > rows {
        let remedy = "find the poses of all cameras, or move the folders and videos of those without a row elsewhere";
        return Err(DataError::field(table, "shape", problem, remedy));
    }
    let numbers: Option<Vec<usize>> = cameras.iter().map(|camera| number_of(&camera.name)).collect();
    if let Some(numbers) = numbers.filter(|numbers| numbers.iter().all(|number| *number < rows)) {
        return Ok(numbers);
    }
    let remedy = "remove the rows of the cameras that are not there, or put the cameras back";
    Err(DataError::field(table, "shape", problem, remedy))
}

/// The number at the end of a name.
pub(super) fn number_of(name: &str) -> Option<usize> {
    let start =
        name.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + name[i..].chars().next().map_or(1, char::len_utf8));
    name[start..].parse().ok()
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
        assert!(message.contains("3 rows for 2 cameras (cam00, cam20); remove the rows"), "{message}");
        let message = rows(table, &named(&["a", "b"]), 1).unwrap_err().to_string();
        assert!(message.contains("1 rows for 2 cameras (a, b); find the poses of all cameras"), "{message}");
    }
}
