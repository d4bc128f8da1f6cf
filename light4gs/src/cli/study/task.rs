//! One task: a training, and the runs that differ from it only in how the file is written.

use std::path::PathBuf;

use clap::Args;
use light4gs_lab::study::manifest::{Manifest, StudyFolder};
use light4gs_lab::study::results::is_finished;
use light4gs_lab::study::reuse::find_trained;
use light4gs_train::error::TrainError;

use super::super::launch::{noting_failure, when_free};
use super::super::output::tell;
use super::super::signals::stop_flag;
use super::super::train::{RunOutput, train_to_evaluation};
use super::super::training::Trainings;

#[derive(Debug, Args)]
pub(in crate::cli) struct StudyTask {
    /// Folder of the study.
    study: PathBuf,
    /// Number of the task.
    task: usize,
    /// Show no progress bars.
    #[arg(long)]
    quiet: bool,
}

impl StudyTask {
    pub(in crate::cli) fn run(self, trainings: &Trainings) -> Result<(), TrainError> {
        // Installed first, so that no request is lost.
        stop_flag();
        let (folder, manifest) = StudyFolder::open(&self.study)?;
        if self.task >= manifest.tasks() {
            let (study, tasks) = (self.study.display(), manifest.tasks());
            return Err(TrainError::Input(format!(
                "{study} has tasks 0 to {}, not {}",
                tasks.saturating_sub(1),
                self.task
            )));
        }
        noting_failure(&folder, self.task, || run_task(&folder, &manifest, self.task, trainings, self.quiet))
    }
}

fn run_task(
    folder: &StudyFolder,
    manifest: &Manifest,
    task: usize,
    trainings: &Trainings,
    quiet: bool,
) -> Result<(), TrainError> {
    let mut trained: Option<PathBuf> = None;
    for run in manifest.task(task) {
        let path = folder.path(&run.name);
        if !is_finished(&path) {
            if !quiet {
                tell(&run.name);
            }
            let config = folder.config_of(run)?;
            let scene = &manifest.scenes[run.scene].path;
            let output = RunOutput { json: false, quiet, profile: false };
            if trained.is_none() {
                trained = find_trained(&manifest.reuse, scene, &config, run.training.as_deref())?;
            }
            let training = trainings.by_name(run.training.as_deref())?;
            let train =
                || train_to_evaluation(training, config.clone(), scene, &path, trained.as_deref(), &output).map(drop);
            when_free(&path, train)?;
        }
        trained.get_or_insert(path);
    }
    Ok(())
}
