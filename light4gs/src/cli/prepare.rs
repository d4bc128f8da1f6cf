//! `prepare`, and its progress.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use light4gs_data::{PrepareEvent, PrepareOptions, prepare};
use light4gs_train::error::TrainError;

use super::output::{say, tell};

#[derive(Debug, Args)]
pub(super) struct Prepare {
    /// One video of a moving camera, or the videos of several cameras that were started together.
    #[arg(required = true, value_name = "VIDEO")]
    videos: Vec<PathBuf>,
    /// Folder to make. If the folder was begun with the same videos and options, `prepare` continues it.
    #[arg(long)]
    out: PathBuf,
    /// Frames to take from each video, spread evenly over it.
    #[arg(long, default_value_t = 200)]
    frames: usize,
    /// Wider frames are scaled down to this width, in pixels.
    #[arg(long, default_value_t = 1600, value_name = "PIXELS")]
    max_width: u32,
    /// Find a pose for every frame, for a rig whose cameras move. By default, the cameras of a rig are assumed to stand
    /// still, and each camera gets one pose.
    #[arg(long)]
    moving: bool,
    /// Show no progress.
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
        let mut phases = Phases::new(self.quiet);
        let summary = prepare(&options, &mut |event| phases.hear(event))?;
        phases.end();
        say(&summary)?;
        let out = options.out.display();
        say(format_args!("\nnext: light4gs train {out} --out runs/my-scene"))?;
        if summary.frames < 2 {
            tell(format_args!("note: {} frame with a pose is too little to train on", summary.frames));
        }
        Ok(())
    }
}

/// How long a log is silent in a phase.
const SILENCE: Duration = Duration::from_secs(30);

/// The progress of `prepare`: a bar for each phase on a terminal, and a line for each in a log.
pub(super) struct Phases {
    quiet: bool,
    terminal: bool,
    phase: &'static str,
    begun: Instant,
    /// When the log has had its last line of this phase; `None` after the line about its end.
    said: Option<Instant>,
    bar: ProgressBar,
}

impl Phases {
    /// `quiet` shows notes only.
    pub(super) fn new(quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let now = Instant::now();
        Self { quiet, terminal, phase: "", begun: now, said: None, bar: ProgressBar::hidden() }
    }

    pub(super) fn hear(&mut self, event: PrepareEvent) {
        match event {
            PrepareEvent::Note(note) => self.bar.suspend(|| tell(format_args!("note: {note}"))),
            _ if self.quiet => {}
            // Once more the end of a phase that has had its line.
            PrepareEvent::Progress { phase, done, total }
                if done == total && phase == self.phase && self.said.is_none() => {}
            PrepareEvent::Progress { phase, done, total } => {
                if phase != self.phase || self.said.is_none() {
                    self.begin(phase, total);
                }
                self.bar.set_position(done as u64);
                // When all images have a pose, the mapper goes on to improve them.
                if done == total && phase != "poses" {
                    self.finish(&total.to_string());
                } else {
                    self.still(done, total);
                }
            }
            PrepareEvent::Placed { images, total } => self.finish(&format!("{images} of {total}")),
        }
    }

    /// Removes the last bar.
    pub(super) fn end(&self) {
        self.bar.finish();
    }

    fn begin(&mut self, phase: &'static str, total: usize) {
        self.bar.finish();
        (self.phase, self.begun, self.said) = (phase, Instant::now(), Some(Instant::now()));
        if self.terminal {
            let template = "{prefix:>8} {wide_bar:.cyan/blue} {pos}/{len}  {elapsed}  ETA {eta}";
            let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            self.bar = ProgressBar::new(total as u64).with_style(style).with_prefix(phase);
            // The clock goes on while a program says nothing.
            self.bar.enable_steady_tick(Duration::from_secs(1));
        }
    }

    /// A line now and then, so that a log shows that work goes on.
    fn still(&mut self, done: usize, total: usize) {
        if self.terminal || self.said.is_none_or(|said| said.elapsed() < SILENCE) {
            return;
        }
        self.said = Some(Instant::now());
        let left = self.begun.elapsed().as_secs_f64() * (total - done) as f64 / done.max(1) as f64;
        let left = if done > 0 { format!(", about {left:.0} s left") } else { String::new() };
        tell(format_args!("{}: {done} of {total}{left}", self.phase));
    }

    fn finish(&mut self, what: &str) {
        self.bar.finish();
        if !self.terminal && self.said.is_some() && self.phase != "dataset" {
            tell(format_args!("{}: {what} in {:.0} s", self.phase, self.begun.elapsed().as_secs_f64()));
        }
        self.said = None;
    }
}
