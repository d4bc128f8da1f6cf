//! The ways to train a task of a study: as the configuration says, and those that a program adds.

use std::marker::PhantomData;

use light4gs_data::Scene;
use light4gs_model::{BuiltInField, DeformationField};
use light4gs_report::evaluate_run;
use light4gs_train::compression::{ConfiguredModels, EntropyModels};
use light4gs_train::config::Config;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::Evaluation;
use light4gs_train::run::RunFolder;
use light4gs_train::trainer::{Trainer, TrainerBuilder};

use super::train::{RunOutput, in_folder, run};

/// From its first iteration to its measured file.
pub(super) trait Training {
    /// Whether a run can begin, before a folder is made for it.
    fn check(&self, config: Config, data: Scene) -> Result<(), TrainError>;

    /// Begins the run of a folder or continues it, up to the written file.
    fn train(&self, config: Config, data: Scene, folder: &RunFolder, output: &RunOutput) -> Result<(), TrainError>;

    /// Measures the file.
    fn evaluate(&self, folder: &RunFolder, config: &Config, data: &Scene) -> Result<Evaluation, TrainError>;
}

/// A training by the builder of a trainer.
struct Built<F, E, B> {
    builder: B,
    parts: PhantomData<(F, E)>,
}

impl<F, E, B> Training for Built<F, E, B>
where
    F: DeformationField,
    E: EntropyModels,
    B: Fn(Config, Scene) -> TrainerBuilder<F, E>,
{
    fn check(&self, config: Config, data: Scene) -> Result<(), TrainError> {
        (self.builder)(config, data).check()
    }

    fn train(&self, config: Config, data: Scene, folder: &RunFolder, output: &RunOutput) -> Result<(), TrainError> {
        run(&mut in_folder((self.builder)(config, data), folder, output).resume()?, output)
    }

    fn evaluate(&self, folder: &RunFolder, config: &Config, data: &Scene) -> Result<Evaluation, TrainError> {
        evaluate_run::<F>(folder, config, data)
    }
}

/// The trainings of a program.
pub(super) struct Trainings {
    configured: Box<dyn Training>,
    /// By name.
    added: Vec<(String, Box<dyn Training>)>,
}

impl Default for Trainings {
    fn default() -> Self {
        let parts = PhantomData::<(BuiltInField, ConfiguredModels)>;
        Self { configured: Box::new(Built { builder: Trainer::builder, parts }), added: Vec::new() }
    }
}

impl Trainings {
    pub(super) fn add<F, E>(&mut self, name: &str, builder: impl Fn(Config, Scene) -> TrainerBuilder<F, E> + 'static)
    where
        F: DeformationField + 'static,
        E: EntropyModels + 'static,
    {
        self.added.push((name.to_owned(), Box::new(Built { builder, parts: PhantomData })));
    }

    /// Names of those that the program has added.
    pub(super) fn names(&self) -> Vec<String> {
        self.added.iter().map(|(name, _)| name.clone()).collect()
    }

    /// As the configuration says.
    pub(super) fn configured(&self) -> &dyn Training {
        &*self.configured
    }

    /// The training with this name; without one, as the configuration says.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a name that the program does not know, as in a study that another program began.
    pub(super) fn by_name(&self, name: Option<&str>) -> Result<&dyn Training, TrainError> {
        let Some(name) = name else { return Ok(self.configured()) };
        let found = self.added.iter().find(|(added, _)| added == name);
        found.map(|(_, training)| &**training).ok_or_else(|| {
            TrainError::Input(format!(
                "this program has no training \"{name}\"; the program that began the study has it: go on with that one"
            ))
        })
    }
}
