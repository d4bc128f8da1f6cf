//! `synth`.

use std::path::PathBuf;

use clap::Args;
use light4gs_data::{SyntheticOptions, TakeOptions, write_synthetic, write_take};
use light4gs_train::error::TrainError;

use super::output::say;

#[derive(Debug, Args)]
pub(super) struct Synth {
    /// Folder to make.
    out: PathBuf,
    /// Width and height in pixels.
    #[arg(long, default_value_t = 200, allow_negative_numbers = true, conflicts_with = "seconds")]
    resolution: u32,
    /// Training images.
    #[arg(long, default_value_t = 100, allow_negative_numbers = true, conflicts_with = "seconds")]
    train_frames: usize,
    /// Test images.
    #[arg(long, default_value_t = 20, allow_negative_numbers = true, conflicts_with = "seconds")]
    test_frames: usize,
    /// Validation images.
    #[arg(long, default_value_t = 10, allow_negative_numbers = true, conflicts_with = "seconds")]
    val_frames: usize,
    /// Seed of the scene and of its cameras.
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// Make a take of this number of seconds: a room in which objects come, go and rest.
    #[arg(long, allow_negative_numbers = true)]
    seconds: Option<f64>,
    #[command(flatten)]
    take: Take,
}

/// Options of a take.
#[derive(Debug, Args)]
struct Take {
    /// Number of cameras of a take. A single camera moves; several cameras stand still, and one more camera is for
    /// testing [default: 1].
    #[arg(long, requires = "seconds", allow_negative_numbers = true)]
    cameras: Option<usize>,
    /// Frames per second of a take [default: 30].
    #[arg(long, requires = "seconds", allow_negative_numbers = true)]
    fps: Option<f64>,
    /// Width of a take's images in pixels [default: 320].
    #[arg(long, requires = "seconds", allow_negative_numbers = true)]
    width: Option<u32>,
    /// Height of a take's images in pixels [default: 240].
    #[arg(long, requires = "seconds", allow_negative_numbers = true)]
    height: Option<u32>,
    /// The camera of a take jumps to another place at this second.
    #[arg(long, value_name = "SECONDS", requires = "seconds", allow_negative_numbers = true)]
    cut: Option<f64>,
    /// The light of a take begins to change at this second, and has changed after half a second.
    #[arg(long, value_name = "SECONDS", requires = "seconds", allow_negative_numbers = true)]
    light: Option<f64>,
}

impl Take {
    fn options(&self, seconds: f64, seed: u64) -> TakeOptions {
        let usual = TakeOptions::default();
        TakeOptions {
            seconds,
            cameras: self.cameras.unwrap_or(usual.cameras),
            frames_a_second: self.fps.unwrap_or(usual.frames_a_second),
            width: self.width.unwrap_or(usual.width),
            height: self.height.unwrap_or(usual.height),
            cut: self.cut,
            light: self.light,
            seed,
        }
    }
}

impl Synth {
    pub(super) fn run(self) -> Result<(), TrainError> {
        match self.seconds {
            Some(seconds) => write_take(&self.out, &self.take.options(seconds, self.seed))?,
            None => {
                let options = SyntheticOptions {
                    resolution: self.resolution,
                    train_frames: self.train_frames,
                    test_frames: self.test_frames,
                    val_frames: self.val_frames,
                    seed: self.seed,
                };
                write_synthetic(&self.out, &options)?;
            }
        }
        say(format_args!("wrote {}", self.out.display()))
    }
}
