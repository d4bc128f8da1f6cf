//! `prepare`.

use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use light4gs_data::{PrepareOptions, PrepareProgress, prepare};
use light4gs_train::error::TrainError;

use super::output::{say, tell};

#[derive(Debug, Args)]
pub(super) struct Prepare {
    /// One video of a moving camera, or the videos of several cameras that were started together.
    #[arg(required = true, value_name = "VIDEO")]
    videos: Vec<PathBuf>,
    /// Folder to make; a folder that was begun with the same videos and options is continued.
    #[arg(long)]
    out: PathBuf,
    /// Frames to take from each video, spread evenly over it.
    #[arg(long, default_value_t = 200)]
    frames: usize,
    /// Wider frames are scaled down to this width, in pixels.
    #[arg(long, default_value_t = 1600, value_name = "PIXELS")]
    max_width: u32,
    /// The cameras of a rig move, so every frame gets a pose of its own. Without this option they stand still.
    #[arg(long)]
    moving: bool,
    /// No progress bars.
    #[arg(long)]
    quiet: bool,
}

impl Prepare {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let options = PrepareOptions {
            videos: self.videos,
            out: self.out,
            frames: self.frames,
            max_width: self.max_width,
            moving_rig: self.moving,
        };
        let mut bars = PhaseBars { quiet: self.quiet, phase: "", bar: ProgressBar::hidden() };
        let summary = prepare(&options, &mut |progress| bars.show(&progress))?;
        bars.bar.finish();
        say(&summary)?;
        let out = options.out.display();
        say(format_args!("\nnext: light4gs train {out} --out runs/my-scene"))?;
        if summary.frames < 2 {
            tell(format_args!("note: {} frame with a pose is too little to train on", summary.frames));
        }
        Ok(())
    }
}

/// A bar for each phase, one after the other.
struct PhaseBars {
    quiet: bool,
    phase: &'static str,
    bar: ProgressBar,
}

impl PhaseBars {
    fn show(&mut self, progress: &PrepareProgress) {
        if self.quiet {
            return;
        }
        if progress.phase != self.phase {
            self.bar.finish();
            self.phase = progress.phase;
            let template = "{prefix:>8} {wide_bar:.cyan/blue} {pos}/{len}  {elapsed}";
            let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            self.bar = ProgressBar::new(progress.total as u64).with_style(style).with_prefix(progress.phase);
        }
        self.bar.set_position(progress.done as u64);
    }
}
