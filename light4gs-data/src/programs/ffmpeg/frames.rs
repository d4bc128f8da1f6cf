//! Frames of a video, as files in a folder.

use super::filters::{Chain, chain};
use super::info::VideoInfo;
use super::taken::Taken;
use super::{FFMPEG, passthrough};
use crate::atomic::make_folder_atomically;
use crate::error::DataError;
use crate::programs::{Heard, argument};
use std::fs;
use std::path::Path;
use std::process::Command;

/// A container that promises more than this many frames, and more than this share of its duration, was cut short. Sound may
/// be a little longer than the video.
const MISSING_FRAMES: f64 = 5.0;
const MISSING_SHARE: f64 = 0.03;

/// The frames to take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Pace {
    /// Every frame, whenever it is shown.
    #[default]
    All,
    /// The first frame of each stretch of time; so many stretches a second.
    FirstOfEach(f64),
    /// As many frames per second, evenly: frames are left out or doubled.
    Resampled(f64),
}

/// The wanted frames of a video, and their size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Wanted {
    /// Wider videos are scaled down to this width, pixels.
    pub(crate) max_width: Option<u32>,
    /// Which frames.
    pub(crate) pace: Pace,
    /// At most this many, from the first.
    pub(crate) count: Option<usize>,
    /// As JPEG files of high quality instead of PNG: a tenth of the size.
    pub(crate) jpeg: bool,
}

impl Wanted {
    /// The suffix of the frames.
    pub(super) fn suffix(&self) -> &'static str {
        if self.jpeg { "jpg" } else { "png" }
    }
}

/// Writes the frames of a video as `0000.png`, `0001.png`... (or `.jpg`) into a new folder, which is complete or absent, with
/// a record of their times. `done` is called with the number of frames that are written.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg is absent, too old, or cannot read the video; [`DataError::Io`] where the folder
/// cannot be made.
pub(crate) fn extract_frames(
    video: &Path,
    info: &VideoInfo,
    folder: &Path,
    wanted: &Wanted,
    done: &mut dyn FnMut(usize),
) -> Result<Taken, DataError> {
    let version = FFMPEG.version()?;
    let video = std::path::absolute(video).map_err(DataError::io("read", video))?;
    let Chain { filters, mut notes } = chain(info, wanted)?;
    if let Some(parent) = folder.parent() {
        fs::create_dir_all(parent).map_err(DataError::io("create", parent))?;
    }
    let mut taken = None;
    make_folder_atomically(folder, |part| {
        let attempt = format!("extracting frames of {}", video.display());
        let remedy = "check that the video plays; convert it to MP4 with H.264";
        let mut times = Times::default();
        let mut line = |line: Option<&str>| {
            let Some(line) = line else { return Heard::Forget };
            if times.hear(line) {
                done(times.seconds.len());
            }
            if line.contains("[error]") || line.contains("[fatal]") { Heard::Quote } else { Heard::Forget }
        };
        FFMPEG.stream(&mut extraction(version, &video, part, wanted, &filters), &mut line, &attempt, remedy)?;
        let written = fs::read_dir(part).map_err(DataError::io("read", part))?.count();
        if written == 0 {
            let problem = format!("found no frame in {}", video.display());
            return Err(FFMPEG.error(problem, "check that the file is a video"));
        }
        notes.extend(times.cut_short(info, wanted, written));
        let record = Taken::of(&video, std::mem::take(&mut notes), times.relative(written, info))?;
        record.write(part)?;
        // As it will be read from now on: text rounds times.
        taken = Taken::read(part, written);
        Ok(())
    })?;
    taken.ok_or_else(|| FFMPEG.error("wrote no frames", "try again"))
}

/// The command that writes the frames into a folder.
fn extraction(version: (u32, u32), video: &Path, folder: &Path, wanted: &Wanted, filters: &str) -> Command {
    let mut command = FFMPEG.command();
    // The pattern of names is given without a folder: a `%` in a folder's name would be taken as a part of the pattern.
    command.current_dir(folder).args(["-hide_banner", "-nostats", "-loglevel", "level+info", "-nostdin", "-i"]);
    // Of the video streams the first that is no cover picture.
    command.arg(video).args(["-map", "0:V:0", "-vf", filters]);
    command.args(passthrough(version));
    if let Some(count) = wanted.count {
        command.arg("-frames:v").arg(argument(count));
    }
    if wanted.jpeg {
        // The best quality of the encoder, without color subsampling.
        command.args(["-q:v", "1", "-qmin", "1", "-pix_fmt", "yuvj444p"]);
    }
    command.args(["-start_number", "0"]).arg(format!("%04d.{}", wanted.suffix()));
    command
}

/// Times of frames, as the filter `showinfo` prints them.
#[derive(Debug, Default)]
struct Times {
    /// Seconds of a unit of the times.
    unit: Option<f64>,
    seconds: Vec<Option<f64>>,
}

impl Times {
    /// Whether the line told of a frame.
    fn hear(&mut self, line: &str) -> bool {
        if !line.contains("showinfo") {
            return false;
        }
        let word = |name: &str| Some(line.split_once(name)?.1.split_whitespace().next()?.to_owned());
        if let Some(base) = word("config in time_base:").filter(|_| line.contains("config in")) {
            let parts: Option<(f64, f64)> =
                base.trim_end_matches(',').split_once('/').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
            self.unit = parts.map(|(a, b)| a / b).filter(|unit| unit.is_finite() && *unit > 0.0);
            return false;
        }
        if !line.contains(" n:") || !line.contains(" pts_time:") {
            return false;
        }
        // `pts_time` has six digits only.
        let exact = word(" pts:").and_then(|pts| Some(pts.parse::<f64>().ok()? * self.unit?));
        self.seconds.push(exact.or_else(|| word(" pts_time:")?.parse().ok()).filter(|time| time.is_finite()));
        true
    }

    /// The times of the frames that were written, from the first, increasing. Where the container has none, or wrong ones,
    /// they follow from the mean rate.
    fn relative(&self, written: usize, info: &VideoInfo) -> Vec<f64> {
        let known: Option<Vec<f64>> = self.seconds.iter().take(written).copied().collect();
        let orderly = |times: &Vec<f64>| times.len() == written && times.windows(2).all(|pair| pair[0] < pair[1]);
        match known.filter(orderly) {
            Some(times) => times.iter().map(|time| time - times[0]).collect(),
            None => (0..written).map(|i| i as f64 / if info.rate > 0.0 { info.rate } else { 1.0 }).collect(),
        }
    }

    /// A note, if the frames end before the container says so.
    fn cut_short(&self, info: &VideoInfo, wanted: &Wanted, written: usize) -> Option<String> {
        let last = self.seconds.iter().take(written).copied().next_back()??;
        let step = match wanted.pace {
            Pace::All => 1.0 / info.rate,
            Pace::FirstOfEach(rate) | Pace::Resampled(rate) => 1.0 / rate,
        };
        let missing = info.duration - last - step;
        let whole = wanted.count.is_none_or(|count| written < count);
        if !(whole && missing * info.rate > MISSING_FRAMES && missing > MISSING_SHARE * info.duration) {
            return None;
        }
        let (found, promised) = ((last + step) * info.rate, info.duration * info.rate);
        Some(format!(
            "its frames end after {:.2} s (about {found:.0} frames) where the container says {:.2} s (about {promised:.0}): \
             the file is damaged or was cut short; copy it again",
            last + step,
            info.duration
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_exactly() {
        let mut times = Times::default();
        assert!(!times.hear("[Parsed_showinfo_4 @ 0x5] [info] config in time_base: 1/30000, frame_rate: 25/1"));
        assert!(!times.hear("[info] frame=    4 fps=0.0"));
        assert!(times.hear("[Parsed_showinfo_4 @ 0x5] [info] n:   0 pts:   3000 pts_time:0.1     pos:   48 fmt:a"));
        assert!(times.hear("[Parsed_showinfo_4 @ 0x5] [info] n:   1 pts:3703703 pts_time:123.457 pos:   48 fmt:a"));
        assert!(times.hear("[Parsed_showinfo_4 @ 0x5] [info] n:   2 pts:6000000 pts_time:200     pos:   48 fmt:a"));
        let info = VideoInfo { duration: 200.0, rate: 2.0, ..VideoInfo::default() };
        // The last one was not written.
        assert_eq!(times.relative(2, &info), [0.0, 3_700_703.0 / 30_000.0]);
        assert_eq!(times.relative(4, &info), [0.0, 0.5, 1.0, 1.5]);
        let note = times.cut_short(&info, &Wanted::default(), 2).unwrap();
        assert!(note.contains("about 248 frames") && note.contains("about 400"), "{note}");
        assert!(times.cut_short(&info, &Wanted { count: Some(2), ..Wanted::default() }, 2).is_none());
        assert!(times.cut_short(&info, &Wanted::default(), 3).is_none());
    }
}
