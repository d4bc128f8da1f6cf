//! Tables and report from the runs that are finished.

use std::path::PathBuf;

use clap::Args;
use light4gs_lab::study::figures::{figures, write_report};
use light4gs_lab::study::manifest::{Manifest, StudyFolder};
use light4gs_lab::study::quality_curves::{QualityCurves, quality_curves};
use light4gs_lab::study::remaining::Remaining;
use light4gs_lab::study::results::Results;
use light4gs_lab::study::rows::record;
use light4gs_lab::study::selection::Selection;
use light4gs_lab::study::table::{StudyTable, legend, tables, to_markdown};
use light4gs_train::error::TrainError;
use serde::Serialize;

use super::super::output::{say, say_json, tell};

#[derive(Debug, Args)]
pub(in crate::cli) struct Gather {
    /// Folder of the study.
    study: PathBuf,
    /// Print the results as JSON.
    #[arg(long)]
    json: bool,
}

impl Gather {
    pub(in crate::cli) fn run(self) -> Result<(), TrainError> {
        let (folder, manifest) = StudyFolder::open(&self.study)?;
        gather(&folder, &manifest, &Selection::all(&manifest), self.json)
    }
}

/// `results.json`.
#[derive(Serialize)]
struct ResultsFile<'a> {
    #[serde(flatten)]
    results: &'a Results,
    tables: &'a [StudyTable],
    curves: &'a [QualityCurves],
}

/// Writes tables and report from the finished runs, and prints the tables.
///
/// # Errors
/// [`TrainError::Input`] if selected runs are missing, after everything has been written.
pub(super) fn gather(
    folder: &StudyFolder,
    manifest: &Manifest,
    selection: &Selection,
    json: bool,
) -> Result<(), TrainError> {
    let results = Results::read(folder, manifest)?;
    let tables = tables(manifest, &results);
    let curves = quality_curves(manifest, &results);
    let file = ResultsFile { results: &results, tables: &tables, curves: &curves };
    folder.write_json("results.json", &file)?;
    folder.write("record.json", format!("{}\n", record(manifest, &results, &curves)).as_bytes())?;
    folder.write("results.csv", results.to_csv(manifest, false).as_bytes())?;
    folder.write("times.csv", results.to_csv(manifest, true).as_bytes())?;
    folder.write("table.md", to_markdown(manifest, &results, &tables, &curves).as_bytes())?;
    let figures = figures(folder, manifest, &results, &curves)?;
    write_report(folder, manifest, &results, &tables, &curves, &figures)?;
    if json {
        say_json(&file)?;
    } else {
        for table in &tables {
            say(table.to_text())?;
        }
        say(legend(manifest))?;
    }
    if results.missing.is_empty() {
        return Ok(());
    }
    for missing in results.missing.iter().filter(|missing| selection.has(&missing.run)) {
        tell(format_args!("missing: {}: {}", missing.run, missing.state));
    }
    tell(Remaining::of(manifest, &results));
    if !results.missing.iter().any(|missing| selection.has(&missing.run)) {
        return Ok(());
    }
    Err(TrainError::Input(format!(
        "{} of {} runs are missing; the command that began the study goes on with them",
        results.missing.len(),
        manifest.runs.len()
    )))
}
