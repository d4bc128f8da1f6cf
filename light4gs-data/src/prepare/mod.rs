//! From videos to a dataset: frames by `ffmpeg`, poses by COLMAP, a folder that is read as layout `nerfstudio`.
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
use crate::programs::colmap::Colmap;
use crate::programs::ffmpeg::{FFMPEG, Pace, VideoInfo, Wanted, extract_frames, frame_count, video_info};
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

/// What [`prepare`] tells its caller while it works.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PrepareEvent {
    /// The progress of a phase.
    Progress {
        /// The phase: `frames`, `features`, `matches`, `poses` or `dataset`.
        phase: &'static str,
        /// Steps that are done.
        done: usize,
        /// Steps in all.
        total: usize,
    },
    /// All images were tried: so many have a pose.
    Placed {
        /// Images with a pose.
        images: usize,
        /// Images in all.
        total: usize,
    },
    /// A sentence about what was found or changed.
    Note(String),
}

impl PrepareEvent {
    fn progress(phase: &'static str, done: usize, total: usize) -> Self {
        Self::Progress { phase, done, total }
    }
}

/// Makes a dataset from videos, or continues one that was stopped. `tell` is called while it works.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg or COLMAP are absent, too old or fail, with what to do; [`DataError::Exists`] where
/// the folder holds something else; [`DataError::Field`] where no poses are found, with the likely reason;
/// [`DataError::Options`] and [`DataError::Io`] as they say.
pub fn prepare(options: &PrepareOptions, tell: &mut dyn FnMut(PrepareEvent)) -> Result<PrepareSummary, DataError> {
    options.check()?;
    FFMPEG.version()?;
    let colmap = Colmap::find()?;
    let mut record = Record::open(&options.out, Settings::of(options)?)?;
    let cameras = camera_folders(options);
    if !record.is_done(Phase::Frames) {
        frames(options, &cameras, &mut record, tell)?;
        record.done(Phase::Frames)?;
    }
    let model = poses::reconstruct(options, &cameras, &colmap, &mut record, tell)?;
    let summary = write::dataset(options, &cameras, model, record.notes().to_vec())?;
    record.done(Phase::Dataset)?;
    tell(PrepareEvent::progress("dataset", 1, 1));
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
    record: &mut Record,
    tell: &mut dyn FnMut(PrepareEvent),
) -> Result<(), DataError> {
    let infos = options.videos.iter().map(|video| video_info(video)).collect::<Result<Vec<_>, _>>()?;
    if let Some(note) = about_durations(&options.videos, &infos) {
        tell(record.note(note)?);
    }
    let pace = match &options.videos[..] {
        // As many as there are: none is left out.
        [video] if frame_count(video)?.is_some_and(|count| count <= options.frames) => Pace::All,
        _ => pace(&infos, options.frames),
    };
    let of_video = |info: &VideoInfo| match pace {
        // A video may have fewer frames than are asked for.
        Pace::All if info.duration * info.rate >= 1.0 => {
            options.frames.min((info.duration * info.rate).round() as usize)
        }
        _ => options.frames,
    };
    let total: usize = infos.iter().map(of_video).sum();
    let mut before = 0;
    for (i, (video, camera)) in options.videos.iter().zip(cameras).enumerate() {
        tell(PrepareEvent::progress("frames", before, total));
        let folder = options.out.join("images").join(camera);
        let wanted = Wanted { max_width: Some(options.max_width), pace, count: Some(options.frames), jpeg: true };
        if !folder.is_dir() || files::images(&folder)?.is_empty() {
            let mut done = |done: usize| tell(PrepareEvent::progress("frames", (before + done).min(total), total));
            let taken = extract_frames(video, &infos[i], &folder, &wanted, &mut done)?;
            for note in taken.notes {
                tell(record.note(format!("{}: {note}", taken.video))?);
            }
        }
        before += of_video(&infos[i]);
    }
    tell(PrepareEvent::progress("frames", total, total));
    Ok(())
}

/// A note, if the videos of a rig last differently long: the shortest decides.
fn about_durations(videos: &[PathBuf], infos: &[VideoInfo]) -> Option<String> {
    let by_duration = |a: &usize, b: &usize| infos[*a].duration.total_cmp(&infos[*b].duration);
    let shortest = (0..infos.len()).min_by(by_duration)?;
    let longest = (0..infos.len()).max_by(by_duration)?;
    let of = |i: usize| format!("{} lasts {:.2} s", files::name_of(&videos[i]), infos[i].duration);
    let more = infos[longest].duration - infos[shortest].duration;
    (more > 0.02 * infos[longest].duration && more > 0.1).then(|| {
        format!("{}, {}: the first {:.2} s of all are used", of(shortest), of(longest), infos[shortest].duration)
    })
}

/// Which frames to take. Those of a rig must be of the same times, so its videos are resampled to one rate, however few frames
/// there are: even at equal nominal rates a phone drops frames. Those of a single camera are frames of the video, and have their
/// own times.
fn pace(infos: &[VideoInfo], frames: usize) -> Pace {
    let durations = infos.iter().map(|info| info.duration).filter(|duration| *duration > 0.0);
    let shortest = durations.fold(f64::INFINITY, f64::min);
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
