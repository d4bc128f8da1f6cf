//! Takes: `train --segment`, `extend`, `join`, and the task that launchers start.

mod measure;
mod task;

use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_data::Scene;
use light4gs_lab::study::results::is_finished;
use light4gs_train::config::Config;
use light4gs_train::dataset::{load_options, passing_images};
use light4gs_train::error::TrainError;
use light4gs_train::take::{SegmentLength, TakeFolder, TakePlan, cuts};

pub(super) use measure::{eval_file, eval_folder, info, is_take_file};
pub(super) use task::TakeTask;

use super::launch::{LaunchOptions, Launcher, TaskFolder, local, slurm};
use super::output::say;

/// The task that trains the base; segment `i` is task `i + 1`.
const BASE: usize = 0;

impl TaskFolder for TakeFolder {
    const TASK: &'static str = "take-task";
    const JOBS: &'static str = "light4gs-take";
    const GATHER: &'static str = "join";

    fn root(&self) -> &Path {
        self.root()
    }
}

/// Trains the base of a take and its segments, and writes its file. Segments that are finished are not trained again.
pub(super) fn train_take(
    config: &Config,
    scene: &Path,
    out: &Path,
    plan: TakePlan,
    launch: &LaunchOptions,
    quiet: bool,
) -> Result<(), TrainError> {
    let data = Scene::open(scene, &load_options(config))?;
    let folder = TakeFolder::create(out, scene, &data, plan, config)?;
    train_missing(&folder, launch, quiet)
}

/// How a capture is divided into segments.
pub(super) fn plan_of(config: &Config, scene: &Path, length: SegmentLength) -> Result<TakePlan, TrainError> {
    let data = Scene::open(scene, &load_options(config))?;
    let seconds = seconds_of(&data)?;
    TakePlan::of(&data, seconds, length, &cuts(&data, &passing_images(config))?)
}

/// Goes on with the training of a take, one part after the other.
pub(super) fn resume_take(root: &Path, quiet: bool) -> Result<(), TrainError> {
    train_missing(&TakeFolder::open(root)?, &LaunchOptions::one_by_one(), quiet)
}

/// The length of a take.
fn seconds_of(data: &Scene) -> Result<f64, TrainError> {
    data.seconds.ok_or_else(|| {
        TrainError::Input(format!(
            "how long {} lasts is not known, so it cannot be divided into segments of seconds; give the frames per second: \
             --set data.frames_a_second=30",
            data.root.display()
        ))
    })
}

/// Trains what of a take is not finished, and writes its file.
fn train_missing(folder: &TakeFolder, launch: &LaunchOptions, quiet: bool) -> Result<(), TrainError> {
    let settings = launch.settings()?;
    let out = folder.root();
    let plan = &folder.record().plan;
    let count = plan.segments.len();
    say(format_args!(
        "a take of {:.2} seconds, {} frames: a base, and {count} segments of about {:.2} seconds",
        plan.seconds,
        plan.frames,
        plan.seconds / count as f64
    ))?;
    let logs = out.join(".logs");
    std::fs::create_dir_all(&logs).map_err(light4gs_data::DataError::io("create", &logs))?;
    let base = if is_finished(&folder.base()) { Vec::new() } else { vec![BASE] };
    let segments: Vec<usize> =
        (0..count).filter(|number| !is_finished(&folder.segment(*number))).map(|number| number + 1).collect();
    match launch.launcher {
        Launcher::Local => {
            local::run_all(folder, base, 1, quiet)?;
            if !is_finished(&folder.base()) {
                return Err(unfinished(folder, BASE, "the base"));
            }
            local::run_all(folder, segments, launch.jobs as usize, quiet)?;
            join(folder)?;
            match (0..count).find(|number| !is_finished(&folder.segment(*number))) {
                Some(number) => Err(unfinished(folder, number + 1, &format!("segment {number}"))),
                None => Ok(()),
            }
        }
        Launcher::Slurm => slurm::submit(folder, &[base, segments], launch.jobs, &settings),
    }
}

/// The error for a part that is still missing.
fn unfinished(folder: &TakeFolder, task: usize, part: &str) -> TrainError {
    let said = std::fs::read_to_string(folder.failure(task)).unwrap_or_default();
    let root = folder.root().display();
    TrainError::Input(format!(
        "{part} is not finished: {} (the same command goes on; logs are in {root}/.logs)",
        said.trim()
    ))
}

fn join(folder: &TakeFolder) -> Result<(), TrainError> {
    let bytes = folder.join()?;
    let plan = &folder.record().plan;
    let trained = folder.trained();
    let frames: usize = trained.iter().map(|number| plan.segments[*number].frames).sum();
    say(format_args!(
        "{}: {bytes} bytes, {} of {} segments, {:.2} kB per frame",
        folder.file().display(),
        trained.len(),
        plan.segments.len(),
        bytes as f64 / 1e3 / frames.max(1) as f64
    ))
}

#[derive(Debug, Args)]
pub(super) struct Extend {
    /// Folder of a trained take.
    run: PathBuf,
    /// Folder of a dataset that has more frames after those of the take. The dataset may be the take's own, with new
    /// frames.
    scene: PathBuf,
    #[command(flatten)]
    launch: LaunchOptions,
    /// Show no progress bars.
    #[arg(long)]
    quiet: bool,
}

impl Extend {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let mut folder = TakeFolder::open(&self.run)?;
        let data = Scene::open(&self.scene, &load_options(folder.config()))?;
        let seconds = seconds_of(&data)?;
        let cuts = cuts(&data, &passing_images(folder.config()))?;
        folder.extend(&self.scene, &data, seconds, &cuts)?;
        train_missing(&folder, &self.launch, self.quiet)
    }
}

#[derive(Debug, Args)]
pub(super) struct Join {
    /// Folder of a take.
    run: PathBuf,
}

impl Join {
    pub(super) fn run(self) -> Result<(), TrainError> {
        join(&TakeFolder::open(&self.run)?)
    }
}
