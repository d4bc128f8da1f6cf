//! Starts tasks, each a process of this program: on this machine, or as jobs of a Slurm cluster.

pub(super) mod local;
pub(super) mod slurm;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, ValueEnum};
use light4gs_lab::study::results::is_finished;
use light4gs_train::error::TrainError;

use super::output::tell;
use super::signals::stop_flag;

/// Time between two attempts to lock a run that another process holds.
const PAUSE: Duration = Duration::from_millis(500);

/// The launcher of the tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Launcher {
    /// Processes on this machine.
    Local,
    /// A job array on a Slurm cluster; the command returns as soon as the job array is submitted.
    Slurm,
}

/// How tasks are started.
#[derive(Debug, Args)]
pub(super) struct LaunchOptions {
    /// Where the tasks run. A task trains a run of a study, or the base or a segment of a take.
    #[arg(long, value_enum, default_value = "local")]
    pub(super) launcher: Launcher,
    /// Number of tasks (see --launcher) that run at the same time.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(super) jobs: u32,
    /// TOML file with partition, account, GPUs for each task, and wall time; see docs/studies.md.
    #[arg(long, value_name = "FILE")]
    slurm: Option<PathBuf>,
}

impl LaunchOptions {
    /// One task after the other, on this machine.
    pub(super) fn one_by_one() -> Self {
        Self { launcher: Launcher::Local, jobs: 1, slurm: None }
    }

    /// The settings of Slurm.
    ///
    /// # Errors
    /// [`TrainError::Input`] for settings without that launcher, and for a file that is none.
    pub(super) fn settings(&self) -> Result<slurm::Settings, TrainError> {
        match &self.slurm {
            Some(_) if self.launcher != Launcher::Slurm => {
                Err(TrainError::Input("--slurm is for --launcher slurm; give that too, or leave it out".into()))
            }
            Some(path) => slurm::Settings::load(path),
            None => Ok(slurm::Settings::default()),
        }
    }
}

/// A folder with numbered tasks. Logs and messages of tasks lie in its folder `.logs`.
pub(super) trait TaskFolder {
    /// The hidden command that runs one task: `PROGRAM COMMAND FOLDER NUMBER`.
    const TASK: &'static str;
    /// The name of its jobs on a cluster.
    const JOBS: &'static str;
    /// The command that puts together what the tasks have made: `PROGRAM COMMAND FOLDER`.
    const GATHER: &'static str;

    /// The folder.
    fn root(&self) -> &Path;

    /// The file for a task's output.
    fn log(&self, task: usize) -> PathBuf {
        self.root().join(".logs").join(format!("task-{task}.log"))
    }

    /// The file for the message of a task that failed.
    fn failure(&self, task: usize) -> PathBuf {
        self.root().join(".logs").join(format!("task-{task}.failed"))
    }
}

/// Notes how a task ended, for its launcher: removes the message of an earlier attempt, and writes one of this.
pub(super) fn noting_failure(
    folder: &impl TaskFolder,
    task: usize,
    run: impl FnOnce() -> Result<(), TrainError>,
) -> Result<(), TrainError> {
    let failure = folder.failure(task);
    let _ = std::fs::remove_file(&failure);
    let result = run();
    match &result {
        Ok(()) | Err(TrainError::Stopped(_)) => {}
        // If the message cannot be written, the launcher knows only the exit code.
        Err(error) => drop(std::fs::write(&failure, format!("{error}\n"))),
    }
    result
}

/// Runs `train`; while another process holds the run, waits for it. That may be the same task on a node that was lost.
pub(super) fn when_free(run: &Path, train: impl Fn() -> Result<(), TrainError>) -> Result<(), TrainError> {
    let stop = stop_flag();
    let mut told = false;
    loop {
        match train() {
            Err(error @ (TrainError::RunInUse { .. } | TrainError::RunExists(_))) => {
                if stop.load(std::sync::atomic::Ordering::Relaxed) {
                    return Err(TrainError::Stopped(format!("stopped on request: {error}")));
                }
                if !std::mem::replace(&mut told, true) {
                    tell(format_args!("waiting: {error}"));
                }
                std::thread::sleep(PAUSE);
                if is_finished(run) {
                    return Ok(());
                }
            }
            result => return result,
        }
    }
}
