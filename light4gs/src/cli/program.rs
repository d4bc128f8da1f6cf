//! The program: its commands, and the parts that another crate adds to them.

use std::process::ExitCode;

use clap::Parser;
use light4gs_data::Scene;
use light4gs_model::DeformationField;
use light4gs_train::compression::EntropyModels;
use light4gs_train::config::Config;
use light4gs_train::trainer::TrainerBuilder;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

use super::training::Trainings;
use super::{Cli, gpu_errors, output, report};

/// The program `light4gs`, to which a crate of your own adds what it tries.
///
/// A program with two lines has all commands, and a deformation field, a loss or any other part of your own in the tables of
/// `study`. A value of a study's axis asks for it by its name (docs/studies.md):
///
/// ```no_run
/// use light4gs::cli::Program;
/// use light4gs::model::{BuiltInField, BuiltInFieldConfig};
/// use light4gs::train::trainer::Trainer;
///
/// fn main() -> std::process::ExitCode {
///     // In a study: value = [{ name = "nodes" }, { name = "still", training = "nothing-moves" }]
///     let still = BuiltInFieldConfig::Still(());
///     Program::default()
///         .training("nothing-moves", move |config, data| {
///             Trainer::<BuiltInField>::builder_with_field(config, data, still.clone())
///         })
///         .main()
/// }
/// ```
#[derive(Default)]
pub struct Program {
    trainings: Trainings,
}

impl Program {
    /// Adds a training, for the values of a study's axes with this `training`. `builder` gets the complete configuration of a
    /// run and its dataset, and gives the trainer with all parts of its own; folder, progress bars and requests to stop are added
    /// to it. A study calls it in a process of its own for each task, so that it has to give the same each time.
    #[must_use]
    pub fn training<F, E>(
        mut self,
        name: &str,
        builder: impl Fn(Config, Scene) -> TrainerBuilder<F, E> + 'static,
    ) -> Self
    where
        F: DeformationField + 'static,
        E: EntropyModels + 'static,
    {
        self.trainings.add(name, builder);
        self
    }

    /// Parses the arguments of this process, runs the command, and reports an error on stderr. Exit codes: 0 done, 2 wrong
    /// input, 1 a bug, 75 stopped on request (SIGUSR1).
    pub fn main(self) -> ExitCode {
        let wanted = std::env::var("RUST_LOG").ok().and_then(|text| text.parse::<Targets>().ok());
        let filter = wanted.unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
        tracing_subscriber::registry()
            .with(tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_filter(filter))
            .init();
        match gpu_errors::catch(|| Cli::parse().run(&self.trainings)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                output::tell(format_args!("error: {error}"));
                report::remember(&error);
                ExitCode::from(error.exit_code())
            }
        }
    }
}
