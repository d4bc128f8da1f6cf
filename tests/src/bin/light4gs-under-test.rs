//! The program for the command-line tests. Cargo builds the binaries of the package under test, but not those of its
//! dependencies, so this package has its own. For studies it has a training of its own, as a crate outside of this workspace may.

use light4gs::cli::Program;
use light4gs::model::{BuiltInField, BuiltInFieldConfig};
use light4gs::train::trainer::Trainer;

fn main() -> std::process::ExitCode {
    Program::default()
        .training("nothing-moves", |config, data| {
            Trainer::<BuiltInField>::builder_with_field(config, data, BuiltInFieldConfig::Still(()))
        })
        .main()
}
