//! The folder of each camera's frames; taken from its video where there is none, or where it is that of another video.

use super::cameras::CameraFrames;
use crate::digest::Content;
use crate::error::DataError;
use crate::layouts::shared::files;
use crate::programs::ffmpeg::{Taken, Wanted, extract_frames, video_info};
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

/// Frames are extracted at the reference's width; the genuine videos are twice as wide.
const EXTRACTED_WIDTH: u32 = 1352;

/// The folder of a camera's frames, and notes about how they were taken.
pub(super) struct Folder {
    pub(super) path: PathBuf,
    pub(super) notes: Vec<String>,
}

/// The folder of a camera's frames. They are extracted beside the video, or into the user's cache where the dataset cannot be
/// written, or where only the first `length` frames are wanted.
pub(super) fn folder(root: &Path, camera: &CameraFrames, length: Option<usize>) -> Result<Folder, DataError> {
    let mut notes = Vec::new();
    if let Some(folder) = &camera.folder {
        let replaced = match (&camera.video, Taken::read(folder, files::images(folder)?.len())) {
            (Some(video), Some(taken)) if !taken.is_of(video)? => Some(taken),
            _ => None,
        };
        let Some(taken) = replaced else {
            return Ok(Folder { path: folder.clone(), notes });
        };
        taken.remove(folder)?;
        notes.push("it was replaced after its frames had been taken: they were taken again".to_owned());
    }
    let Some(video) = &camera.video else {
        return Err(DataError::field(root, camera.name.clone(), "no frames and no video", "put one of them there"));
    };
    Ok(Folder { path: extracted(root, camera, video, length)?, notes })
}

fn extracted(root: &Path, camera: &CameraFrames, video: &Path, length: Option<usize>) -> Result<PathBuf, DataError> {
    let wanted = Wanted { max_width: Some(EXTRACTED_WIDTH), count: length, ..Wanted::default() };
    let info = video_info(video)?;
    // Beside the video, where the reference puts them too. A part of the sequence is not put there, since other
    // programs would take it for the whole.
    let beside = root.join(&camera.name).join("images");
    let metadata = root.metadata().map_err(DataError::io("read", root))?;
    if !metadata.permissions().readonly() && wanted.count.is_none() {
        match extract_frames(video, &info, &beside, &wanted, &mut |_| {}) {
            // The folder cannot be written.
            Err(DataError::Io { .. }) => {}
            done => return done.map(|_| beside),
        }
    }
    let folder = cache_folder(camera, video, &wanted)?;
    if !folder.is_dir() {
        extract_frames(video, &info, &folder, &wanted, &mut |_| {})?;
    }
    Ok(folder)
}

/// A folder for the frames of this video, where the dataset is read-only.
fn cache_folder(camera: &CameraFrames, video: &Path, wanted: &Wanted) -> Result<PathBuf, DataError> {
    let mut hasher = DefaultHasher::new();
    let place = video.canonicalize().map_err(DataError::io("read", video))?;
    (place, Content::of(video)?, wanted.count).hash(&mut hasher);
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
