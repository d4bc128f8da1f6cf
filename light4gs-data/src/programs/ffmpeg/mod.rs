//! Frames of videos, through the program `ffmpeg`.

mod filters;
mod frames;
mod info;
mod taken;
#[cfg(test)]
pub(crate) mod tests;

pub(crate) use frames::{Pace, Wanted, extract_frames};
pub(crate) use info::{VideoInfo, frame_count, video_info};
pub(crate) use taken::Taken;

use super::Program;

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

/// The option by which frames are written as they come: no frame is doubled or dropped, whatever rate the container says.
fn passthrough(version: (u32, u32)) -> [&'static str; 2] {
    if version >= FPS_MODE { ["-fps_mode", "passthrough"] } else { ["-vsync", "0"] }
}
