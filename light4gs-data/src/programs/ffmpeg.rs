//! Frames of videos, through the program `ffmpeg`.

use super::{Program, argument};
use crate::atomic::make_folder_atomically;
use crate::error::DataError;
use std::fs;
use std::path::Path;
use std::process::Command;

/// The program.
pub(crate) const FFMPEG: Program = Program {
    name: "ffmpeg",
    variable: "LIGHT4GS_FFMPEG",
    version_arguments: &["-version"],
    oldest: (4, 0),
    install: "install it with `apt install ffmpeg`, `brew install ffmpeg` or from https://ffmpeg.org",
};

/// The version since which the option for frame rates is `-fps_mode`.
const FPS_MODE: (u32, u32) = (5, 1);

/// The wanted frames of a video, and their size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Wanted {
    /// Wider videos are scaled down to this width, pixels.
    pub(crate) max_width: Option<u32>,
    /// Frames a second; `None`: every frame.
    pub(crate) rate: Option<f64>,
    /// At most this many, from the first.
    pub(crate) count: Option<usize>,
    /// As JPEG files of high quality instead of PNG: a tenth of the size.
    pub(crate) jpeg: bool,
}

impl Wanted {
    /// The suffix of the frames.
    pub(crate) fn suffix(&self) -> &'static str {
        if self.jpeg { "jpg" } else { "png" }
    }
}

/// Metadata of a video's container.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VideoInfo {
    /// Seconds; 0 where the container does not say.
    pub(crate) duration: f64,
    /// Frames a second; 0 where the container does not say.
    pub(crate) rate: f64,
}

/// Length and frame rate of a video.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg is absent, or finds no video in the file.
pub(crate) fn video_info(video: &Path) -> Result<VideoInfo, DataError> {
    let place = std::path::absolute(video).map_err(DataError::io("read", video))?;
    // Without an output file ffmpeg prints what it found, and ends with an error.
    let output = FFMPEG.output(FFMPEG.command().args(["-hide_banner", "-nostdin", "-i"]).arg(place))?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    parse_info(&text).ok_or_else(|| {
        let words = super::last_lines(text.as_bytes());
        FFMPEG.error(format!("finds no video in {}: {words}", video.display()), "check that the video plays")
    })
}

fn parse_info(text: &str) -> Option<VideoInfo> {
    let stream = text.lines().find(|line| line.contains("Stream #") && line.contains("Video:"))?;
    let before = |unit: &str| stream.split(',').find_map(|part| part.trim().strip_suffix(unit)?.trim().parse().ok());
    let duration = text.split_once("Duration: ").and_then(|(_, rest)| {
        let clock = rest.split([',', ' ', '\n']).next()?;
        clock.split(':').map(|part| part.parse::<f64>().ok()).try_fold(0.0, |sum, part| Some(60.0 * sum + part?))
    });
    Some(VideoInfo { duration: duration.unwrap_or(0.0), rate: before(" fps").or(before(" tbr")).unwrap_or(0.0) })
}

/// Writes the frames of a video as `0000.png`, `0001.png`... (or `.jpg`) into a new folder, which is complete or absent.
///
/// # Errors
/// [`DataError::Program`] where ffmpeg is absent, too old, or cannot read the video; [`DataError::Io`] where the folder
/// cannot be made.
pub(crate) fn extract_frames(video: &Path, folder: &Path, wanted: &Wanted) -> Result<(), DataError> {
    let version = FFMPEG.version()?;
    let video = std::path::absolute(video).map_err(DataError::io("read", video))?;
    if let Some(parent) = folder.parent() {
        fs::create_dir_all(parent).map_err(DataError::io("create", parent))?;
    }
    make_folder_atomically(folder, |part| {
        let attempt = format!("extracting frames of {}", video.display());
        let remedy = "check that the video plays; convert it to MP4 with H.264";
        FFMPEG.run(&mut extraction(version, &video, part, wanted), &attempt, remedy)?;
        at_least_one(part, &video)
    })
}

/// The command that writes the frames into a folder.
fn extraction(version: (u32, u32), video: &Path, folder: &Path, wanted: &Wanted) -> Command {
    let mut command = FFMPEG.command();
    // The pattern of names is given without a folder: a `%` in a folder's name would be taken as a part of the pattern.
    command.current_dir(folder).args(["-hide_banner", "-loglevel", "error", "-nostdin", "-i"]).arg(video);
    command.args(["-map", "0:v:0"]);
    let mut filters = Vec::new();
    match wanted.rate {
        Some(rate) => filters.push(format!("fps={rate}")),
        // No frame is doubled or dropped, whatever rate the container says.
        None => drop(command.args(if version >= FPS_MODE { ["-fps_mode", "passthrough"] } else { ["-vsync", "0"] })),
    }
    if let Some(width) = wanted.max_width {
        filters.push(format!("scale='min({width},iw)':-1:flags=lanczos"));
    }
    if !filters.is_empty() {
        command.arg("-vf").arg(filters.join(","));
    }
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

fn at_least_one(folder: &Path, video: &Path) -> Result<(), DataError> {
    let mut entries = fs::read_dir(folder).map_err(DataError::io("read", folder))?;
    if entries.next().is_some() {
        return Ok(());
    }
    Err(FFMPEG.error(format!("found no frame in {}", video.display()), "check that the file is a video"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ffmpeg_says_about_a_video() {
        let text = "Input #0, mov,mp4, from 'a.mp4':\n  Duration: 00:01:02.50, start: 0.0, bitrate: 97 kb/s\n  \
                    Stream #0:0[0x1](und): Video: h264 (High), yuv420p, 336x252, 95 kb/s, 29.97 fps, 30 tbr (default)\n";
        assert_eq!(parse_info(text), Some(VideoInfo { duration: 62.5, rate: 29.97 }));
        assert_eq!(parse_info("Duration: N/A,\n Stream #0:0: Video: x"), Some(VideoInfo { duration: 0.0, rate: 0.0 }));
        assert_eq!(parse_info("a.txt: Invalid data found"), None);
    }
}
