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

/// The version from which on the mode of frame rates is called `-fps_mode`.
const FPS_MODE: (u32, u32) = (5, 1);

/// Which frames of a video are wanted, and how large.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Wanted {
    /// Wider videos are scaled down to this width, pixels.
    pub(crate) max_width: Option<u32>,
    /// Frames a second; `None`: every frame.
    pub(crate) rate: Option<f64>,
    /// At most this many, from the first.
    pub(crate) count: Option<usize>,
}

/// Writes the frames of a video as `0000.png`, `0001.png`... into a new folder, which is complete or absent.
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
    // The pattern of names stands alone: a `%` in a folder's name would be taken for a part of it.
    command.current_dir(folder).args(["-hide_banner", "-loglevel", "error", "-nostdin", "-i"]).arg(video);
    command.args(["-map", "0:v:0"]);
    let mut filters = Vec::new();
    match wanted.rate {
        Some(rate) => filters.push(format!("fps={rate}")),
        // Neither doubled nor dropped, whatever the container says about the rate.
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
    command.args(["-start_number", "0", "%04d.png"]);
    command
}

fn at_least_one(folder: &Path, video: &Path) -> Result<(), DataError> {
    let mut entries = fs::read_dir(folder).map_err(DataError::io("read", folder))?;
    if entries.next().is_some() {
        return Ok(());
    }
    Err(FFMPEG.error(format!("found no frame in {}", video.display()), "check that the file is a video"))
}
