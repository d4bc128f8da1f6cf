//! `synth`.

use std::path::PathBuf;

use clap::Args;
use light4gs_data::{SyntheticOptions, write_synthetic};
use light4gs_train::error::TrainError;

use super::output::say;

#[derive(Debug, Args)]
pub(super) struct Synth {
    /// Folder to make.
    out: PathBuf,
    /// Width and height in pixels.
    #[arg(long, default_value_t = 200, allow_negative_numbers = true)]
    resolution: u32,
    /// Training images.
    #[arg(long, default_value_t = 100, allow_negative_numbers = true)]
    train_frames: usize,
    /// Test images.
    #[arg(long, default_value_t = 20, allow_negative_numbers = true)]
    test_frames: usize,
    /// Validation images.
    #[arg(long, default_value_t = 10, allow_negative_numbers = true)]
    val_frames: usize,
    /// Seed of the cameras.
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
}

impl Synth {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let options = SyntheticOptions {
            resolution: self.resolution,
            train_frames: self.train_frames,
            test_frames: self.test_frames,
            val_frames: self.val_frames,
            seed: self.seed,
        };
        write_synthetic(&self.out, &options)?;
        say(format_args!("wrote {}", self.out.display()))
    }
}
