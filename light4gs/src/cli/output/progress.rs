//! Progress bars, as an observer of the trainer.

use indicatif::{ProgressBar, ProgressStyle};
use light4gs_train::Stage;
use light4gs_train::error::TrainError;
use light4gs_train::observers::metrics_log::MetricsRecord;
use light4gs_train::observers::{Observer, SceneInTraining, StepReport};

use super::tell;

/// A bar for each stage, and one for the fitting of entropy models.
pub(in crate::cli) struct ProgressBars {
    hidden: bool,
    stage: ProgressBar,
    fit: FitBar,
}

impl ProgressBars {
    /// `quiet` shows no bars.
    pub(in crate::cli) fn new(quiet: bool) -> Self {
        Self { hidden: quiet, stage: ProgressBar::hidden(), fit: FitBar::new(quiet) }
    }
}

impl Observer for ProgressBars {
    fn on_stage(&mut self, stage: Stage, done: usize, iterations: usize) -> Result<(), TrainError> {
        let template = "{prefix:>6} {wide_bar:.cyan/blue} {pos}/{len}  {per_sec}  ETA {eta}  {msg}";
        self.stage = bar(self.hidden, iterations, template);
        self.stage.set_prefix(stage.name());
        self.stage.set_position(done as u64);
        self.stage.reset_eta();
        Ok(())
    }

    fn on_step(&mut self, _: &StepReport, _: &dyn SceneInTraining) -> Result<(), TrainError> {
        self.stage.inc(1);
        Ok(())
    }

    fn on_log(&mut self, record: &MetricsRecord) -> Result<(), TrainError> {
        if let Some(psnr) = record.psnr {
            self.stage.set_message(format!("{psnr:.2} dB  {} Gaussians", record.gaussians));
        }
        Ok(())
    }

    fn on_warning(&mut self, warning: &str) -> Result<(), TrainError> {
        self.stage.suspend(|| tell(format_args!("warning: {warning}")));
        Ok(())
    }

    fn on_stage_end(&mut self, _: Stage) -> Result<(), TrainError> {
        self.stage.finish();
        Ok(())
    }

    fn on_fit(&mut self, done: usize, iterations: usize) -> Result<(), TrainError> {
        self.fit.show(done, iterations);
        Ok(())
    }
}

/// The progress bar for fitting entropy models, made when fitting begins.
pub(in crate::cli) struct FitBar {
    hidden: bool,
    bar: Option<ProgressBar>,
}

impl FitBar {
    /// `quiet` shows no bar.
    pub(in crate::cli) fn new(quiet: bool) -> Self {
        Self { hidden: quiet, bar: None }
    }

    /// Shows the number of iterations that are done.
    pub(in crate::cli) fn show(&mut self, done: usize, iterations: usize) {
        let template = "   fit {wide_bar:.cyan/blue} {pos}/{len}  {per_sec}  ETA {eta}";
        let bar = self.bar.get_or_insert_with(|| bar(self.hidden, iterations, template));
        bar.set_position(done as u64);
        if done == iterations {
            bar.finish();
        }
    }
}

fn bar(hidden: bool, length: usize, template: &str) -> ProgressBar {
    let bar = if hidden { ProgressBar::hidden() } else { ProgressBar::new(length as u64) };
    bar.set_style(ProgressStyle::with_template(template).expect("a valid template"));
    bar
}
