//! `render`.

mod source;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use light4gs_codec::SceneMeta;
use light4gs_data::{Camera, Frame, LoadOptions, Resolution, Scene, orbit_path};
use light4gs_train::config::DeviceName;
use light4gs_train::error::TrainError;

use self::source::Source;
use super::check_output;
use super::limits::LimitsArgument;
use super::limits::most::{MOST_FRAMES, MOST_SIDE, image_size};
use super::output::say;
use crate::video::{write_gif, write_mp4, write_png_sequence};

/// Radius in world units and elevation in degrees of the orbit, those of the D-NeRF video path.
const ORBIT: (f32, f32) = (4.0, 30.0);

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Path {
    /// The camera goes once around the scene while time runs from 0 to 1.
    Orbit,
    /// The camera stands still at the beginning of the orbit while time runs.
    Fixed,
    /// The camera goes once around the scene while time stands still (see --time).
    Frozen,
}

#[derive(Debug, Args)]
pub(super) struct Render {
    /// The .l4gs file, of a clip or of a take.
    file: PathBuf,
    /// A file that ends in .gif or .mp4 (needs the program ffmpeg), or a folder for PNG frames.
    #[arg(long)]
    out: PathBuf,
    /// Camera path.
    #[arg(long, value_enum, default_value = "orbit")]
    path: Path,
    /// Render the test views of this dataset, not a camera path.
    #[arg(long, conflicts_with = "path")]
    scene: Option<PathBuf>,
    /// Number of frames.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_FRAMES)), allow_negative_numbers = true)]
    frames: u32,
    /// The time of a frozen path, in [0, 1].
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    time: f32,
    /// Width in pixels; by default the width of the training images.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SIDE)), allow_negative_numbers = true)]
    width: Option<u32>,
    /// Distance of the orbit from the origin, world units.
    #[arg(long, default_value_t = ORBIT.0, allow_negative_numbers = true)]
    radius: f32,
    /// Angle of the orbit above the horizon, in degrees.
    #[arg(long, default_value_t = ORBIT.1, allow_negative_numbers = true)]
    elevation: f32,
    /// Frames per second of a GIF or an MP4.
    #[arg(long, default_value_t = 20.0, allow_negative_numbers = true)]
    fps: f32,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0. Takes are drawn on the processor.
    #[arg(long, default_value_t)]
    device: DeviceName,
    #[command(flatten)]
    limits: LimitsArgument,
}

impl Render {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if !(0.0..=1.0).contains(&self.time) {
            return Err(TrainError::Input(format!("--time must be in [0, 1], not {}", self.time)));
        }
        if !(1e-6..=1e6).contains(&self.radius) {
            return Err(TrainError::Input(format!("--radius must be 1e-6 to 1e6, not {}", self.radius)));
        }
        if !(-90.0..=90.0).contains(&self.elevation) {
            return Err(TrainError::Input(format!("--elevation must be -90 to 90 degrees, not {}", self.elevation)));
        }
        check_output(&self.out, &self.file)?;
        let source = Source::open(&self.file, &self.limits.get(), self.device)?;
        let frames = self.camera_frames(source.meta())?;
        let images = frames.iter().map(|frame| source.render(frame));
        let has_extension = |name: &str| self.out.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
        if has_extension("gif") || has_extension("mp4") {
            let count = match has_extension("gif") {
                true => write_gif(&self.out, images, self.fps)?,
                false => write_mp4(&self.out, images, self.fps)?,
            };
            say(format_args!("wrote {} ({count} frames)", self.out.display()))?;
        } else {
            let files = write_png_sequence(&self.out, images)?;
            say(format_args!("wrote {} frames to {}", files.len(), self.out.display()))?;
        }
        Ok(())
    }

    fn camera_frames(&self, meta: &SceneMeta) -> Result<Vec<Frame>, TrainError> {
        let (new_width, new_height) = image_size(meta, self.width)?;
        if let Some(scene) = &self.scene {
            let resolution = Resolution::Exact { width: new_width, height: new_height };
            let options = LoadOptions { resolution, background: meta.background, ..LoadOptions::default() };
            return Ok(Scene::open(scene, &options)?.test);
        }
        let intrinsics = Camera::look_at(
            [0.0, -1.0, 0.0].into(),
            [0.0; 3].into(),
            [0.0, 0.0, 1.0].into(),
            meta.fov_x,
            meta.width.max(1),
            meta.height.max(1),
        )
        .resized(new_width, new_height);
        let path = orbit_path(self.frames as usize, self.radius, self.elevation, &intrinsics);
        let first = path[0].0;
        let frame = |(k, (camera, time)): (usize, (Camera, f32))| {
            let (camera, time) = match self.path {
                Path::Orbit => (camera, time),
                Path::Fixed => (first, time),
                Path::Frozen => (camera, self.time),
            };
            Frame::without_image(format!("{k:04}"), camera, time)
        };
        Ok(path.into_iter().enumerate().map(frame).collect())
    }
}
