//! One task of a take: the training of its base, or of a segment.

use std::path::PathBuf;

use clap::Args;
use light4gs_lab::study::results::is_finished;
use light4gs_train::error::TrainError;
use light4gs_train::take::TakeFolder;

use super::super::launch::{noting_failure, when_free};
use super::super::output::tell;
use super::super::signals::stop_flag;
use super::super::train::{RunOutput, train_to_evaluation};
use super::super::training::{Training, Trainings};
use super::BASE;

#[derive(Debug, Args)]
pub(in crate::cli) struct TakeTask {
    /// Folder of the take.
    take: PathBuf,
    /// Number of the task: 0 is the base, segment i is task i + 1.
    task: usize,
    /// Show no progress bars.
    #[arg(long)]
    quiet: bool,
}

impl TakeTask {
    pub(in crate::cli) fn run(self, trainings: &Trainings) -> Result<(), TrainError> {
        // Installed first, so that no request is lost.
        stop_flag();
        let folder = TakeFolder::open(&self.take)?;
        let segments = folder.record().plan.segments.len();
        if self.task > segments {
            let take = self.take.display();
            return Err(TrainError::Input(format!("{take} has tasks 0 to {segments}, not {}", self.task)));
        }
        noting_failure(&folder, self.task, || run_task(&folder, self.task, trainings.configured(), self.quiet))
    }
}

fn run_task(folder: &TakeFolder, task: usize, training: &dyn Training, quiet: bool) -> Result<(), TrainError> {
    let (name, run, config) = match task {
        BASE => ("the base".to_owned(), folder.base(), folder.config_of_base()),
        _ => {
            let number = task - 1;
            let segment = &folder.record().plan.segments[number];
            (format!("segment {number}"), folder.segment(number), folder.config_of_segment(segment)?)
        }
    };
    if is_finished(&run) {
        return Ok(());
    }
    if !quiet {
        tell(&name);
    }
    let output = RunOutput { json: false, quiet, profile: false };
    let scene = &folder.record().scene;
    when_free(&run, || train_to_evaluation(training, config.clone(), scene, &run, None, &output).map(drop))
}
