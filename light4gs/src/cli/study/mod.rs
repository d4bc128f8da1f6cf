//! `study` and `gather`, and the task that launchers start.

mod gather;
mod task;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_lab::study::manifest::{Manifest, ManifestRun, StudyFolder};
use light4gs_lab::study::plan::{Plan, PlanOptions};
use light4gs_lab::study::results::is_finished;
use light4gs_lab::study::reuse::find_trained;
use light4gs_lab::study::selection::Selection;
use light4gs_lab::study::{Study as Definition, catalog};
use light4gs_train::config::DeviceName;
use light4gs_train::error::TrainError;
use light4gs_train::table::{Align, Table};
use serde::Serialize;

pub(super) use gather::Gather;
pub(super) use task::StudyTask;

use super::command_line::command_line;
use super::launch::{LaunchOptions, Launcher, TaskFolder, local, slurm};
use super::output::{say, say_json};
use super::training::Trainings;

impl TaskFolder for StudyFolder {
    const TASK: &'static str = "study-task";
    const JOBS: &'static str = "light4gs-study";
    const GATHER: &'static str = "gather";

    fn root(&self) -> &Path {
        self.root()
    }

    fn failure(&self, task: usize) -> PathBuf {
        self.failure(task)
    }
}

#[derive(Debug, Args)]
pub(super) struct Study {
    /// A study of the paper (see docs/reproduce.md), or a TOML file of your own; `list` prints the names.
    name: String,
    /// Folders of the datasets.
    scenes: Vec<PathBuf>,
    /// Folder for the runs, the tables and the report. Finished runs are not repeated, and runs that differ only in how
    /// the file is written share one training.
    #[arg(long)]
    out: Option<PathBuf>,
    /// The preset or TOML file that variants start from; {scene} in this name stands for the scene's name. By default,
    /// the preset that the study names, or hexplane-dnerf-cpu if it names none. If a value of an axis of the study
    /// names a preset of its own, variants with this value start from that preset.
    #[arg(long, value_name = "PRESET|FILE")]
    config: Option<String>,
    /// Factor by which the length of every variant's schedule is multiplied, such as 0.25 for a first look.
    #[arg(long, value_name = "FACTOR")]
    schedule: Option<f64>,
    /// Changes one key of every variant's configuration; may be given more than once.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    /// Number of runs of each variant on each scene, each with a seed of its own. With several seeds, tables show means
    /// and standard deviations.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Folder of another study, whose finished trainings are reused. A run is not trained if the other study has a
    /// finished run with the same training. This option may be given more than once.
    #[arg(long, value_name = "STUDY")]
    reuse: Vec<PathBuf>,
    /// Train only the runs whose names SCENE/VALUE+VALUE/seed-K have all of these parts, such as 400,small,seed-0. If
    /// several parts are scenes, one of these scenes is enough; the same holds for several values of one axis and for
    /// several seeds. All other runs stay missing.
    #[arg(long, value_delimiter = ',', value_name = "PART")]
    only: Vec<String>,
    /// Print the runs, without training.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    launch: LaunchOptions,
    /// Print the results as JSON.
    #[arg(long)]
    json: bool,
    /// Show no progress bars.
    #[arg(long)]
    quiet: bool,
}

impl Study {
    pub(super) fn run(self, trainings: &Trainings) -> Result<(), TrainError> {
        if self.name == "list" {
            return list();
        }
        let mut overrides = self.overrides;
        overrides.extend(self.device.map(|device| format!("device={device}")));
        let (config, scenes, schedule) = (self.config, self.scenes, self.schedule);
        let (seeds, reuse) = (self.seeds, self.reuse);
        let (command, trainings) = (command_line(), trainings.names());
        let options = PlanOptions { config, scenes, schedule, overrides, seeds, trainings, reuse, command };
        let plan = Plan::new(Definition::load(&self.name)?, &options)?;
        for study in &plan.reuse {
            StudyFolder::open(study)?;
        }
        let names: Vec<String> = plan.scenes.iter().map(|scene| scene.name.clone()).collect();
        let selection = Selection::new(&self.only, &plan.study, &names, plan.seeds)?;
        if self.dry_run {
            return dry_run(&plan, &selection, self.out, self.json);
        }
        let settings = self.launch.settings()?;
        let out = self.out.ok_or_else(|| TrainError::Input("--out is missing: the folder for the runs".into()))?;
        let (folder, manifest) = StudyFolder::create(&out, &plan)?;
        let tasks = unfinished(&folder, &manifest, &selection);
        let jobs = self.launch.jobs;
        match self.launch.launcher {
            Launcher::Local => {
                local::run_all(&folder, tasks, jobs as usize, self.quiet || self.json)?;
                gather::gather(&folder, &manifest, &selection, self.json)
            }
            Launcher::Slurm => slurm::submit(&folder, &[tasks], jobs, &settings),
        }
    }
}

/// Prints the names of the built-in studies.
fn list() -> Result<(), TrainError> {
    let mut table = Table::new([("study", Align::Left), ("reproduces", Align::Left)]);
    for name in catalog::NAMES {
        table.row([(*name).to_owned(), Definition::load(name)?.reproduces]);
    }
    say(table)
}

/// The state of a run of a plan.
#[derive(Serialize)]
struct Planned<'a> {
    task: usize,
    run: &'a str,
    state: &'static str,
    /// Whether another study has trained it.
    reused: bool,
    iterations: usize,
    configuration: String,
}

fn dry_run(plan: &Plan, selection: &Selection, out: Option<PathBuf>, json: bool) -> Result<(), TrainError> {
    let mut trained = BTreeSet::new();
    let mut rows = Vec::new();
    for run in plan.runs.iter().filter(|run| selection.has(&run.name)) {
        let path = out.as_ref().map(|out| out.join(&run.name));
        let state = match path {
            Some(path) if is_finished(&path) => "finished",
            Some(path) if path.join("run.json").is_file() => "begun",
            _ => "to do",
        };
        let train = &run.config.train;
        let (first, scene) = (trained.insert(run.task), &plan.scenes[run.scene].path);
        let reused = first && find_trained(&plan.reuse, scene, &run.config, run.training.as_deref())?.is_some();
        let iterations = if first && !reused { train.coarse_iterations + train.fine_iterations } else { 0 };
        rows.push(Planned {
            task: run.task,
            run: &run.name,
            state,
            reused,
            iterations,
            configuration: run.config.digest_text(),
        });
    }
    if json {
        return say_json(&rows);
    }
    let columns = [
        ("task", Align::Right),
        ("run", Align::Left),
        ("state", Align::Left),
        ("iterations", Align::Right),
        ("configuration", Align::Left),
    ];
    let mut table = Table::new(columns);
    for row in &rows {
        let iterations = match row.iterations {
            0 if row.reused => "reused".to_owned(),
            0 => "trained above".to_owned(),
            iterations => iterations.to_string(),
        };
        let configuration = row.configuration[..12].to_owned();
        table.row([row.task.to_string(), row.run.to_owned(), row.state.to_owned(), iterations, configuration]);
    }
    say(table)?;
    let total: usize = rows.iter().map(|row| row.iterations).sum();
    let finished = rows.iter().filter(|row| row.state == "finished").count();
    let tasks = trained.len();
    say(format_args!("{} runs in {tasks} tasks, {total} iterations; {finished} runs are finished", rows.len()))
}

/// The tasks with selected runs that are not finished.
fn unfinished(folder: &StudyFolder, manifest: &Manifest, selection: &Selection) -> Vec<usize> {
    let is_to_do = |run: &ManifestRun| selection.has(&run.name) && !is_finished(&folder.path(&run.name));
    (0..manifest.tasks()).filter(|task| manifest.task(*task).any(is_to_do)).collect()
}
