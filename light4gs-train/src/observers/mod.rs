//! Observers of a run: progress bars, logs, viewers.
//!
//! - this file: [`Observer`], the calls that the trainer makes
//! - `metrics_log`: the log of a run folder
//!
//! The progress bars of the command line are an observer as well (`cli/progress.rs`).

pub mod metrics_log;

use std::path::Path;

use burn::tensor::Tensor;
use light4gs_model::GaussianTensors;

use crate::error::TrainError;
use crate::stage::Stage;
use metrics_log::MetricsRecord;

/// The results of an iteration.
#[derive(Clone, Debug)]
pub struct StepReport {
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1.
    pub iteration: usize,
    /// The whole loss: views, rate and regularizers.
    pub loss: f32,
    /// `[H, W, 3]`: the last view of the batch as rendered, before the optimizer's step; off the tape.
    pub image: Tensor<3>,
    /// `[H, W, 3]`: its training image.
    pub truth: Tensor<3>,
    /// Index of that view among the training frames.
    pub frame: usize,
    /// Number of Gaussians after the iteration.
    pub gaussians: usize,
    /// Seconds of training so far, over all sessions.
    pub seconds: f64,
}

/// The scene of a run in progress, for observers that draw it.
pub trait SceneInTraining {
    /// Raw attributes of the `N` Gaussians at a time in [0, 1], without a tape, as trained so far. In the coarse stage
    /// nothing moves.
    fn gaussians_at(&self, time: f32) -> GaussianTensors;
}

/// Is called when something happens in a run. By default every method does nothing. The trainer waits until it returns.
/// An error of a method ends the run, and [`Trainer::step`](crate::trainer::Trainer::step) returns it.
pub trait Observer: Send {
    /// A stage begins, or continues after `done` of its `iterations`.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_stage(&mut self, stage: Stage, done: usize, iterations: usize) -> Result<(), TrainError> {
        let _ = (stage, done, iterations);
        Ok(())
    }

    /// An iteration is over.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_step(&mut self, step: &StepReport, scene: &dyn SceneInTraining) -> Result<(), TrainError> {
        let _ = (step, scene);
        Ok(())
    }

    /// A line of metrics is due: every `train.log_interval` iterations, and at the end of a stage.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_log(&mut self, record: &MetricsRecord) -> Result<(), TrainError> {
        let _ = record;
        Ok(())
    }

    /// A checkpoint has been written.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_checkpoint(&mut self, path: &Path) -> Result<(), TrainError> {
        let _ = path;
        Ok(())
    }

    /// A stage has ended.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_stage_end(&mut self, stage: Stage) -> Result<(), TrainError> {
        let _ = stage;
        Ok(())
    }

    /// A warning about the training for the user.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_warning(&mut self, warning: &str) -> Result<(), TrainError> {
        let _ = warning;
        Ok(())
    }

    /// Entropy models are being fitted to a finished scene that was trained without them; `done` of `iterations` are
    /// over.
    ///
    /// # Errors
    /// Any error that should end the run.
    fn on_fit(&mut self, done: usize, iterations: usize) -> Result<(), TrainError> {
        let _ = (done, iterations);
        Ok(())
    }
}
