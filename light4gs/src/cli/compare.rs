//! `compare`.

use std::path::PathBuf;

use clap::Args;
use light4gs_train::error::TrainError;
use light4gs_train::run::{Comparison, Difference};
use light4gs_train::table::{Align, Table};

use super::output::{say, say_json};

#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Folders of at least two runs.
    #[arg(required = true, num_args = 2..)]
    runs: Vec<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let comparison = Comparison::new(&self.runs)?;
        if self.json {
            return say_json(&comparison);
        }
        let parts = [
            ("provenance", &comparison.provenance),
            ("configuration", &comparison.configuration),
            ("results", &comparison.results),
        ];
        for (name, differences) in parts {
            match differences.is_empty() {
                true => say(format_args!("{name}: the same\n"))?,
                false => say(table(name, &self.runs, differences))?,
            }
        }
        Ok(())
    }
}

fn table(name: &str, runs: &[PathBuf], differences: &[Difference]) -> Table {
    let columns = runs.iter().map(|run| (run.display().to_string(), Align::Right));
    let mut table = Table::new(std::iter::once((name.to_owned(), Align::Left)).chain(columns));
    for difference in differences {
        let values = difference.values.iter().map(|value| value.clone().unwrap_or_else(|| "–".to_owned()));
        table.row(std::iter::once(difference.key.clone()).chain(values));
    }
    table
}
