//! `train`, `resume`, `eval`.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use light4gs_data::{Layouts, Scene};
use light4gs_model::{BuiltInField, DeformationField};
use light4gs_report::evaluate_run;
use light4gs_train::compression::{CodedPart, CodingRecord, EntropyModels};
use light4gs_train::config::{Config, DeviceName, Overrides};
use light4gs_train::dataset::{image_store, load_options};
use light4gs_train::device::{self, describe};
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::{DecodedScene, Evaluation};
use light4gs_train::metrics::lpips::Lpips;
use light4gs_train::metrics::scores::Scores;
use light4gs_train::run::{RunFolder, RunRecord};
use light4gs_train::table::{Align, Table};
use light4gs_train::take::{SegmentLength, TakeFolder};
use light4gs_train::trainer::{Trainer, TrainerBuilder};

use super::check::{refuse_problems, tell_capture, understand};
use super::launch::{LaunchOptions, Launcher};
use super::limits::LimitsArgument;
use super::output::progress::ProgressBars;
use super::output::{say, say_json, tell};
use super::signals::stop_flag;
use super::take::{self, plan_of, train_take};
use super::training::Training;
use super::videos;
use super::wishes::{Wishes, check_quality};

/// Options for the output of a run.
#[derive(Debug, Args)]
pub(super) struct RunOutput {
    /// Print the result as JSON.
    #[arg(long)]
    pub(super) json: bool,
    /// Show no progress bars.
    #[arg(long)]
    pub(super) quiet: bool,
    /// Print the time of every part of a training step. The run becomes slower, since the program waits for the device
    /// after each part of the step.
    #[arg(long)]
    pub(super) profile: bool,
}

#[derive(Debug, Args)]
pub(super) struct Train {
    /// Folder of the dataset, or videos: one video of a moving camera, or one video for each camera of a rig. Videos
    /// are first prepared in the folder OUT-prepared (see `light4gs prepare`). After an interruption, the same command
    /// continues where it stopped.
    #[arg(required = true, value_name = "SCENE|VIDEO")]
    scene: Vec<PathBuf>,
    /// A preset (see docs/configuration.md) or a TOML file. The default is the preset with the name of the dataset's
    /// layout, such as dnerf, which trains control nodes. The preset paper-dnerf+paper-coding trains the paper's
    /// hexplane with the paper's protocol.
    #[arg(long, value_name = "PRESET|FILE")]
    config: Option<String>,
    /// Layout of the dataset; if this option is not given, the layout is found by content (see docs/data.md).
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Layouts::default().names()))]
    format: Option<String>,
    /// Folder of the run.
    #[arg(long)]
    out: PathBuf,
    /// Changes one key of the configuration; may be given more than once.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    #[command(flatten)]
    wishes: Wishes,
    /// Train a take, for captures of more than about ten seconds. A take has a base that stands still and segments of
    /// about this number of seconds, and plays as one file. With `auto` a segment has two seconds, but at least 45 and
    /// at most 90 frames. No segment crosses a cut. After an interruption, the same command continues the training.
    #[arg(long, value_name = "SECONDS|auto", value_parser = segment_length)]
    segment: Option<SegmentLength>,
    #[command(flatten)]
    launch: LaunchOptions,
    /// Replace an existing run.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    output: RunOutput,
}

impl Train {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let scene = videos::dataset(&self.scene, &self.out, self.output.quiet)?;
        if !self.overwrite && videos::was_begun(&scene, &self.out) {
            let (run, output) = (self.out, self.output);
            let (overrides, device, accept_changed_dataset) = (Vec::new(), None, false);
            return Resume { run, overrides, device, accept_changed_dataset, output }.run();
        }
        let mut overrides = self.overrides;
        overrides.extend(self.device.map(|device| format!("device={device}")));
        overrides.extend(self.format.as_ref().map(|layout| format!("data.layout={layout}")));
        let automatic = self.config.is_none();
        let preset = match (self.config, self.format) {
            (Some(config), _) => config,
            (None, Some(layout)) => Config::preset_of(Layouts::default().by_name(&layout)?)?.to_owned(),
            (None, None) => Config::preset_of(Layouts::default().detect(&scene)?)?.to_owned(),
        };
        if self.segment.is_none() && (self.launch.jobs > 1 || self.launch.launcher != Launcher::Local) {
            return Err(TrainError::Input("--jobs and --launcher are for takes; give --segment SECONDS too".into()));
        }
        let Some(length) = self.segment else {
            let preset = if automatic { self.wishes.preset_for(preset, &overrides, &scene)? } else { preset };
            let config = self.wishes.config(&preset, &overrides, &scene, automatic, self.output.quiet)?;
            return train(on_chosen_device(config), &scene, &self.out, self.overwrite, &self.output);
        };
        let plan = plan_of(&Config::load(&preset, &overrides)?, &scene, length)?;
        // On a cluster each job has a machine, and its own devices; jobs here share them.
        let on_cluster = self.launch.launcher == Launcher::Slurm;
        let machines = if on_cluster { self.launch.jobs } else { 1 };
        let config = self.wishes.config_of_take(&preset, &overrides, &scene, automatic, &plan, machines)?;
        let config = if on_cluster { config } else { on_chosen_device(config) };
        train_take(&config, &scene, &self.out, plan, &self.launch, self.output.quiet)
    }
}

/// The configuration with the device that `auto` means here, which is said, so that a run that is resumed has the same.
fn on_chosen_device(config: Config) -> Config {
    let device = device::chosen(config.device);
    if config.device == DeviceName::Auto {
        let why = match device {
            DeviceName::Wgpu(_) => "a graphics card; --device flex computes on the processor",
            _ => "no graphics card was found",
        };
        tell(format_args!("device: {device} ({why})"));
    }
    Config { device, ..config }
}

/// Captures that last longer, in seconds, are better trained in segments.
const LONGEST_CLIP: f64 = 15.0;

/// The length of a segment.
fn segment_length(text: &str) -> Result<SegmentLength, String> {
    if text == "auto" {
        return Ok(SegmentLength::Usual);
    }
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.1..=600.0).contains(seconds));
    seconds.map(SegmentLength::Seconds).ok_or_else(|| "expected seconds, from 0.1 to 600, or auto".to_owned())
}

/// Trains a new run and measures it, up to the report.
pub(super) fn train(
    config: Config,
    scene: &Path,
    out: &Path,
    overwrite: bool,
    output: &RunOutput,
) -> Result<(), TrainError> {
    // From here on requests to stop are noticed.
    stop_flag();
    let data = check_inputs(&config, scene)?;
    let (capture, _) = understand(&image_store(&config), &data)?;
    tell_capture(&capture);
    refuse_problems(scene, &capture)?;
    if let Some(seconds) = data.seconds.filter(|seconds| *seconds > LONGEST_CLIP) {
        tell(format_args!(
            "note: this capture lasts {seconds:.0} seconds and is trained as one clip, whose motion must be learned at once; \
             `--segment auto` trains it as a take, in segments (docs/takes.md)"
        ));
    }
    // If the encoder would refuse the scene, for example for a point at 3e38, the run that --overwrite replaces must
    // not be lost.
    Trainer::builder(config.clone(), data).check()?;
    let folder = RunFolder::create(out, Some(scene), &config, overwrite)?;
    folder.record_capture(capture)?;
    let (_, record, config) = RunFolder::open(folder.root())?;
    let trainer = trainer(&config, &folder, &record, output)?.build()?;
    finish(trainer, &folder, &config, output)
}

/// Trains in a folder, or continues the run that it holds, and measures the file. A new run takes over the training of
/// `like`, if that is a run which differs only in how the file is written.
///
/// # Errors
/// [`TrainError::Input`] if the folder holds a run of another configuration or another scene.
pub(super) fn train_to_evaluation(
    training: &dyn Training,
    config: Config,
    scene: &Path,
    out: &Path,
    like: Option<&Path>,
    output: &RunOutput,
) -> Result<Evaluation, TrainError> {
    let fresh = !out.join("run.json").exists();
    if fresh {
        let data = check_inputs(&config, scene)?;
        training.check(config.clone(), data)?;
        let folder = RunFolder::create(out, Some(scene), &config, false)?;
        if let Some(like) = like {
            folder.adopt(like, &Scene::open(scene, &load_options(&config))?)?;
        }
        // Dropped here, since the folder is locked again below.
    }
    let (mut folder, record, found) = RunFolder::open(out)?;
    folder.lock()?;
    if found != config || record.dataset()? != std::path::absolute(scene).unwrap_or_else(|_| scene.to_owned()) {
        let out = out.display();
        return Err(TrainError::Input(format!(
            "{out} holds a run of another configuration or scene; name another folder, or remove that one"
        )));
    }
    let data = Scene::open(record.dataset()?, &load_options(&config))?;
    let coded = config.compression.profile.coded().is_some();
    // `bit_maps.json` is the last file that encoding writes.
    if !folder.stream().exists() || (coded && !folder.path("bit_maps.json").exists()) {
        training.train(config.clone(), data.clone(), &folder, output)?;
    }
    training.evaluate(&folder, &config, &data)
}

/// Checks what a run needs from its first iteration to its evaluation: the device, the dataset, files for metrics. It
/// does so before the run's folder is made or emptied, so that a wrong path leaves nothing behind and nothing is lost.
fn check_inputs(config: &Config, scene: &Path) -> Result<Scene, TrainError> {
    let device = device::open(config.device)?;
    Lpips::load(&config.eval.lpips, &device)?;
    Ok(Scene::open(scene, &load_options(config))?)
}

/// A trainer for the folder of a run, with progress bars.
fn trainer(
    config: &Config,
    folder: &RunFolder,
    record: &RunRecord,
    output: &RunOutput,
) -> Result<TrainerBuilder, TrainError> {
    let data = Scene::open(record.dataset()?, &load_options(config))?;
    Ok(in_folder(Trainer::builder(config.clone(), data), folder, output))
}

/// A trainer that writes into a run's folder, with progress bars, which stops on request.
pub(super) fn in_folder<F: DeformationField, E: EntropyModels>(
    builder: TrainerBuilder<F, E>,
    folder: &RunFolder,
    output: &RunOutput,
) -> TrainerBuilder<F, E> {
    builder.run_folder(folder.clone()).observer(ProgressBars::new(output.quiet)).stop_flag(stop_flag())
}

/// Trains to the end, and prints the times of the parts if requested.
pub(super) fn run<F: DeformationField, E: EntropyModels>(
    trainer: &mut Trainer<F, E>,
    output: &RunOutput,
) -> Result<(), TrainError> {
    if output.profile {
        trainer.measure_stages();
    }
    trainer.run()?;
    if let Some(table) = trainer.profile().table() {
        // On stderr, so that stdout is only JSON where that is requested.
        tell(format_args!("{table}\n"));
    }
    Ok(())
}

fn finish(mut trainer: Trainer, folder: &RunFolder, config: &Config, output: &RunOutput) -> Result<(), TrainError> {
    run(&mut trainer, output)?;
    let evaluation = evaluate_run::<BuiltInField>(folder, config, trainer.data())?;
    print_evaluation(&evaluation, output.json)?;
    if !output.json {
        say(format_args!("\nreport: {}", folder.path("report.html").display()))?;
    }
    check_quality(evaluation.coding.as_ref(), &folder.stream())
}

#[derive(Debug, Args)]
pub(super) struct Resume {
    /// Folder of the run, or of a take.
    run: PathBuf,
    /// Changes one key of the run's configuration from now on, for example a learning rate that was too high; may be
    /// given more than once. The changed configuration must fit the trained scene.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// A back end other than the run's: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    /// Continue even if the dataset has changed since the run began.
    #[arg(long)]
    accept_changed_dataset: bool,
    #[command(flatten)]
    output: RunOutput,
}

impl Resume {
    pub(super) fn run(self) -> Result<(), TrainError> {
        stop_flag();
        if TakeFolder::is_one(&self.run) {
            if !self.overrides.is_empty() || self.device.is_some() {
                return Err(TrainError::Input(format!(
                    "{} is a take, whose parts have one configuration: leave out --set and --device",
                    self.run.display()
                )));
            }
            return take::resume_take(&self.run, self.output.quiet);
        }
        let (mut folder, record, found) = RunFolder::open(&self.run)?;
        folder.lock()?;
        let mut config = found.with(&Overrides::parse(&self.overrides)?)?;
        let changed = config.clone();
        config.device = self.device.unwrap_or(config.device);
        check_inputs(&config, record.dataset()?)?;
        let mut builder = trainer(&config, &folder, &record, &self.output)?;
        if self.accept_changed_dataset {
            builder = builder.accept_changed_dataset();
        }
        let trainer = builder.resume()?;
        if changed != found {
            // Written only after the checkpoint has been found to fit. The next `resume` uses it as well.
            folder.write("config.toml", changed.to_toml().as_bytes())?;
        }
        finish(trainer, &folder, &config, &self.output)
    }
}

#[derive(Debug, Args)]
pub(super) struct Eval {
    /// Folder of a run or of a take, or a .l4gs file (then --scene is needed).
    run: PathBuf,
    /// Folder of the dataset, if it is not the run's own.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    /// Weights of LPIPS (see docs/metrics.md), in place of the configuration's `eval.lpips`; may be given more than once.
    #[arg(long, value_name = "FILE")]
    lpips: Vec<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
    /// The dataset, if a file is measured and not a run.
    #[command(flatten)]
    limits: LimitsArgument,
}

impl Eval {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if self.run.is_file() {
            return self.eval_file();
        }
        if TakeFolder::is_one(&self.run) {
            return take::eval_folder(&self.run, self.json);
        }
        let (mut folder, mut record, mut config) = RunFolder::open(&self.run)?;
        folder.lock()?;
        if !folder.stream().exists() {
            let run = self.run.display();
            return Err(TrainError::Input(format!(
                "{run} has no scene.l4gs yet; finish it with `light4gs resume {run}`"
            )));
        }
        config.device = self.device.unwrap_or(config.device);
        if !self.lpips.is_empty() {
            config.eval.lpips = self.lpips;
        }
        record.scene = self.scene.or(record.scene);
        let scene = Scene::open(record.dataset()?, &load_options(&config))?;
        let evaluation = evaluate_run::<BuiltInField>(&folder, &config, &scene)?;
        print_evaluation(&evaluation, self.json)?;
        // Measuring has succeeded, whatever it says.
        if let Some(missed) = evaluation.coding.as_ref().and_then(|coding| coding.missed_quality) {
            tell(missed);
        }
        Ok(())
    }

    fn eval_file(self) -> Result<(), TrainError> {
        let Some(scene) = self.scene.clone() else {
            return Err(TrainError::Input("a .l4gs file holds no images; name the dataset with --scene DIR".into()));
        };
        let name = self.device.unwrap_or_default();
        if take::is_take_file(&self.run) {
            let config = Config { device: name, ..Config::default() };
            return take::eval_file(&self.run, &scene, &config, &self.limits.get(), self.json);
        }
        let device = device::open(name)?;
        let decoded: DecodedScene = DecodedScene::open_with_limits(&self.run, &self.limits.get(), &device)?;
        let mut config = Config::default();
        config.data.resolution = Some(decoded.data.meta.width.max(decoded.data.meta.height));
        config.data.background = decoded.data.meta.background;
        config.eval.lpips = self.lpips.clone();
        let options = load_options(&config);
        let scene = Scene::open(&scene, &options)?;
        let images = image_store(&config);
        let (evaluation, _) = decoded.evaluate(&scene, &images, &config.eval, None, &describe(name, &device))?;
        print_evaluation(&evaluation, self.json)
    }
}

fn print_evaluation(evaluation: &Evaluation, json: bool) -> Result<(), TrainError> {
    if json {
        return say_json(evaluation);
    }
    say(quality_table(evaluation))?;
    say(sections_table(evaluation.sections.iter().map(|s| (s.name.as_str(), s.bytes)), evaluation.bytes))?;
    if let Some(table) = evaluation.coding.as_ref().and_then(coding_table) {
        say(table)?;
    }
    let [width, height] = evaluation.resolution;
    say(format_args!(
        "{} Gaussians, {:.1} FPS at {width}×{height} on {}",
        evaluation.gaussians, evaluation.fps, evaluation.device
    ))?;
    if let Some(seconds) = evaluation.training_seconds {
        say(format_args!("trained for {:.1} min", seconds / 60.0))?;
    }
    evaluation.advice.iter().try_for_each(|advice| say(format_args!("advice: {advice}")))
}

/// Quality by split.
fn quality_table(evaluation: &Evaluation) -> Table {
    let columns = Scores::columns(evaluation.splits.iter().map(|split| &split.scores));
    let names = [("split".to_owned(), Align::Left), ("views".to_owned(), Align::Right)];
    let mut table = Table::new(names.into_iter().chain(columns.iter().map(|column| (column.label(), Align::Right))));
    for split in &evaluation.splits {
        let mut row = |name: String, scores: &Scores| {
            let begin = [name, split.views.len().to_string()];
            table.row(begin.into_iter().chain(columns.iter().map(|column| column.format(scores.get(*column)))));
        };
        row(split.split.clone(), &split.scores);
        if let Some(fitted) = &split.fitted {
            row(format!("{}, each view fitted", split.split), fitted);
        }
    }
    table
}

/// Expected and written bits of the parts that are coded with trained models, if there are any.
pub(super) fn coding_table(record: &CodingRecord) -> Option<Table> {
    let parts: Vec<_> = record.parts().into_iter().filter(CodedPart::is_modeled).collect();
    if parts.is_empty() {
        return None;
    }
    let mut table = Table::new([
        ("entropy coded", Align::Left),
        ("bits expected", Align::Right),
        ("bits in the file", Align::Right),
        ("difference", Align::Right),
    ]);
    let attributes = record.attribute_parts().map(|part| CodedPart { name: format!("  {}", part.name), ..part });
    for part in parts.into_iter().chain(attributes) {
        let (expected, coded) = (format!("{:.0}", part.expected), format!("{:.0}", part.coded));
        table.row([part.name.clone(), expected, coded, part.difference()]);
    }
    Some(table)
}

/// Bytes and shares of a file's parts.
pub(super) fn sections_table<'a>(sections: impl Iterator<Item = (&'a str, u64)>, total: u64) -> Table {
    const BAR: f64 = 40.0;
    let columns = [("section", Align::Left), ("bytes", Align::Right), ("share", Align::Right), ("", Align::Left)];
    let mut table = Table::new(columns);
    let share = |bytes: u64| format!("{:.1} %", 100.0 * bytes as f64 / total as f64);
    for (name, bytes) in sections {
        let bar = "█".repeat((BAR * bytes as f64 / total as f64).round() as usize);
        table.row([name.to_owned(), bytes.to_string(), share(bytes), bar]);
    }
    table.rule().row(["file".to_owned(), total.to_string(), share(total)]);
    table
}
