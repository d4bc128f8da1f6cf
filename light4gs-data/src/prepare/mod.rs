//! From videos to a dataset: frames by `ffmpeg`, poses by `colmap`, a folder that is read as layout `nerfstudio`.
//!
//! The folder holds `images/`, `transforms.json` and `points3D.ply`. `work/` holds COLMAP's database and models, and
//! `prepare.json` records what has been done, so that a second call continues where the first was stopped.

mod poses;
mod record;
mod summary;
#[cfg(test)]
mod tests;
mod write;

pub use summary::PrepareSummary;

use crate::error::DataError;
use crate::layouts::shared::files;
use crate::programs::colmap::COLMAP;
use crate::programs::ffmpeg::{FFMPEG, Pace, VideoInfo, Wanted, extract_frames, video_info};
use record::{Phase, Record, Settings};
use std::fs;
use std::path::{Path, PathBuf};

/// The input and options of [`prepare`].
#[derive(Clone, Debug, PartialEq)]
pub struct PrepareOptions {
    /// One video of a moving camera, or one video for each camera of a rig, all beginning at the same time.
    pub videos: Vec<PathBuf>,
    /// The folder to make.
    pub out: PathBuf,
    /// Frames to take from each video, spread evenly over it; 2 to 10000. A shorter video gives fewer.
    pub frames: usize,
    /// Wider frames are scaled down to this width, pixels.
    pub max_width: u32,
    /// Whether the cameras of a rig move, so that every frame needs a pose of its own. If not, the first frames are
    /// enough.
    pub moving_rig: bool,
}

impl PrepareOptions {
    /// The usual numbers: 200 frames a video, at most 1600 pixels wide, a rig that stands still.
    pub fn new(videos: Vec<PathBuf>, out: PathBuf) -> Self {
        Self { videos, out, frames: 200, max_width: 1600, moving_rig: false }
    }

    fn check(&self) -> Result<(), DataError> {
        let bad = |option: &'static str, problem: String| Err(DataError::Options { option, problem });
        if self.videos.is_empty() {
            return bad("videos", "none given, expected at least one".into());
        }
        if !(2..=10_000).contains(&self.frames) {
            return bad("frames", format!("{}, expected 2 to 10000", self.frames));
        }
        if !(64..=16_384).contains(&self.max_width) {
            return bad("max_width", format!("{}, expected 64 to 16384 pixels", self.max_width));
        }
        for video in &self.videos {
            let kind = fs::metadata(video).map_err(DataError::io("read", video))?;
            if !kind.is_file() {
                return Err(DataError::field(video, "video", "it is no file", "name a video"));
            }
        }
        Ok(())
    }
}

/// The progress of [`prepare`], for its caller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PrepareProgress {
    /// The current phase, such as `features`.
    pub phase: &'static str,
    /// Steps that are done.
    pub done: usize,
    /// Steps in all; 0 where the number is not known.
    pub total: usize,
}

/// Makes a dataset from videos, or continues one that was stopped. `progress` is called while it works.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg or colmap are absent, too old or fail, with what to do; [`DataError::Exists`] where
/// the folder holds something else; [`DataError::Options`] and [`DataError::Io`] as they say.
pub fn prepare(
    options: &PrepareOptions,
    progress: &mut dyn FnMut(PrepareProgress),
) -> Result<PrepareSummary, DataError> {
    options.check()?;
    FFMPEG.version()?;
    COLMAP.version()?;
    let mut record = Record::open(&options.out, Settings::of(options)?)?;
    let cameras = camera_folders(options);
    if !record.is_done(Phase::Frames) {
        frames(options, &cameras, progress)?;
        record.done(Phase::Frames)?;
    }
    poses::reconstruct(options, &cameras, &mut record, progress)?;
    let summary = write::dataset(options, &cameras)?;
    record.done(Phase::Dataset)?;
    progress(PrepareProgress { phase: "dataset", done: 1, total: 1 });
    Ok(summary)
}

/// Where the frames of each video go, relative to `images/`: the folder itself, or one for each camera.
fn camera_folders(options: &PrepareOptions) -> Vec<String> {
    match options.videos.len() {
        1 => vec![String::new()],
        count => (0..count).map(|i| format!("cam{i:02}")).collect(),
    }
}

/// Extracts the frames of every video whose frames are not there yet.
fn frames(
    options: &PrepareOptions,
    cameras: &[String],
    progress: &mut dyn FnMut(PrepareProgress),
) -> Result<(), DataError> {
    let infos = options.videos.iter().map(|video| video_info(video)).collect::<Result<Vec<_>, _>>()?;
    let total = options.frames * options.videos.len();
    for (i, (video, camera)) in options.videos.iter().zip(cameras).enumerate() {
        let before = i * options.frames;
        progress(PrepareProgress { phase: "frames", done: before, total });
        let folder = options.out.join("images").join(camera);
        let count = Some(options.frames);
        let wanted =
            Wanted { max_width: Some(options.max_width), pace: pace(&infos, options.frames), count, jpeg: true };
        if !folder.is_dir() || files::images(&folder)?.is_empty() {
            let mut done =
                |done: usize| progress(PrepareProgress { phase: "frames", done: (before + done).min(total), total });
            extract_frames(video, &infos[i], &folder, &wanted, &mut done)?;
        }
    }
    progress(PrepareProgress { phase: "frames", done: total, total });
    Ok(())
}

/// Which frames to take. Those of a rig must be of the same times, so its videos are resampled to one rate, however few frames
/// there are: even at equal nominal rates a phone drops frames. Those of a single camera are frames of the video, and have their
/// own times.
fn pace(infos: &[VideoInfo], frames: usize) -> Pace {
    let shortest = infos.iter().map(|info| info.duration).fold(f64::INFINITY, f64::min);
    let fastest = infos.iter().map(|info| info.rate).fold(0.0, f64::max);
    let needed = frames as f64 / shortest;
    if !(needed.is_finite() && needed > 0.0) {
        return Pace::All;
    }
    match infos {
        [_] if needed < 0.99 * fastest => Pace::FirstOfEach(needed),
        [_] => Pace::All,
        _ => Pace::Resampled(needed.min(fastest)),
    }
}

/// The frames of each camera, relative to `images/`, as many as the shortest video has.
fn frame_names(out: &Path, cameras: &[String]) -> Result<Vec<Vec<String>>, DataError> {
    let mut lists = Vec::with_capacity(cameras.len());
    for camera in cameras {
        let images = files::images(&out.join("images").join(camera))?;
        let named = images.iter().map(|path| {
            let name = files::name_of(path);
            if camera.is_empty() { name } else { format!("{camera}/{name}") }
        });
        lists.push(named.collect::<Vec<_>>());
    }
    let shortest = lists.iter().map(Vec::len).min().unwrap_or(0);
    for list in &mut lists {
        list.truncate(shortest);
    }
    Ok(lists)
}
