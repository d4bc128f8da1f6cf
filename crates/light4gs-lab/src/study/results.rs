//! The results of the runs so far.
//!
//! `results.json` and `results.csv` hold figures that are the same in every repetition of the study, `times.csv` those that
//! depend on the machine and its load.

use std::path::Path;

use light4gs_train::Stage;
use light4gs_train::compression::CodingRecord;
use light4gs_train::config::Config;
use light4gs_train::error::TrainError;
use light4gs_train::observers::metrics_log::{MetricsRecord, read_metrics};
use light4gs_train::run::{RunFolder, RunRecord};
use serde::{Deserialize, Serialize};

use super::manifest::{Manifest, ManifestRun, StudyFolder};
use super::measure::Measure;

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunResult {
    /// Its folder below the study's.
    pub run: String,
    /// Index of the scene.
    pub scene: usize,
    /// Index of the variant.
    pub variant: usize,
    /// Counted from 0.
    pub seed: u64,
    /// Digest of its configuration.
    pub configuration: String,
    /// Of the test split; of the first measured split where there is none.
    #[serde(flatten)]
    pub quality: Quality,
    /// Mean PSNR of the validation split, dB.
    pub val_psnr: Option<f64>,
    /// Size of the file.
    pub bytes: u64,
    /// By section, header included.
    pub sections: Vec<(String, u64)>,
    /// Gaussians in the file.
    pub gaussians: usize,
    /// Width and height of the measured images.
    pub resolution: [u32; 2],
    /// Color behind the scene, 0 to 1.
    pub background: [f32; 3],
    /// Times in the training frames; `None` if the file does not say.
    pub frames: Option<u32>,
    /// Quantization step of every plane; empty if planes are not coded.
    pub steps: Vec<f64>,
    /// Seconds of training.
    #[serde(skip)]
    pub training_seconds: Option<f64>,
    /// Seconds of fitting entropy models to the finished scene.
    #[serde(skip)]
    pub fit_seconds: Option<f64>,
    /// Seconds of encoding.
    #[serde(skip)]
    pub encode_seconds: Option<f64>,
    /// Seconds of decoding.
    #[serde(skip)]
    pub decode_seconds: f64,
    /// Frames per second.
    #[serde(skip)]
    pub fps: f64,
    /// The device on which it was measured.
    #[serde(skip)]
    pub device: String,
    /// The record of its training.
    #[serde(skip)]
    pub trained: Training,
}

/// Where and when a run was trained.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Training {
    /// Commit of the program.
    pub commit: String,
    /// Processor and cores.
    pub machine: String,
    /// When it began, UTC.
    pub begun: String,
}

impl From<RunRecord> for Training {
    fn from(record: RunRecord) -> Self {
        match record.trained_by {
            Some(other) => (*other).into(),
            None => Self { commit: record.commit, machine: record.machine, begun: record.begun },
        }
    }
}

/// The figures of a split's quality that studies show; `None` if they were not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Mean PSNR, dB.
    pub psnr: Option<f64>,
    /// Mean SSIM.
    pub ssim: Option<f64>,
    /// Mean MS-SSIM.
    pub ms_ssim: Option<f64>,
    /// Mean LPIPS by AlexNet.
    pub lpips_alex: Option<f64>,
    /// PSNR over all pixels that move, dB.
    pub moving_psnr: Option<f64>,
    /// PSNR over all pixels that stand still, dB.
    pub still_psnr: Option<f64>,
    /// SSIM over all pixels that move.
    pub moving_ssim: Option<f64>,
    /// SSIM over all pixels that stand still.
    pub still_ssim: Option<f64>,
    /// PSNR over the worst pixels, dB.
    pub worst_psnr: Option<f64>,
}

/// A run without a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MissingRun {
    /// Its folder below the study's.
    pub run: String,
    /// Its task.
    pub task: usize,
    /// Its state, and the message of its task if that failed.
    pub state: String,
    /// Share of its iterations that are done, 0 to 1.
    #[serde(skip)]
    pub share: f64,
    /// Seconds of training so far.
    #[serde(skip)]
    pub seconds: f64,
}

/// The results of a study's runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    /// In the order of the manifest.
    pub runs: Vec<RunResult>,
    /// In the order of the manifest.
    pub missing: Vec<MissingRun>,
}

/// The parts of `eval.json` that studies show.
#[derive(Deserialize)]
struct EvaluationFile {
    device: String,
    bytes: u64,
    sections: Vec<SectionFile>,
    gaussians: usize,
    resolution: [u32; 2],
    /// JSON has no infinity; it is written as null.
    fps: Option<f64>,
    decode_seconds: f64,
    training_seconds: Option<f64>,
    splits: Vec<SplitFile>,
    #[serde(default)]
    coding: Option<CodingRecord>,
}

#[derive(Deserialize)]
struct SectionFile {
    name: String,
    bytes: u64,
}

#[derive(Deserialize)]
struct SplitFile {
    split: String,
    #[serde(flatten)]
    quality: Quality,
}

/// Whether a run in a folder is finished: `report.html` is written last.
pub fn is_finished(run: &Path) -> bool {
    ["scene.l4gs", "eval.json", "report.html"].iter().all(|name| run.join(name).is_file())
}

impl Results {
    /// Reads the existing results.
    ///
    /// # Errors
    /// A run whose files are damaged.
    pub fn read(folder: &StudyFolder, manifest: &Manifest) -> Result<Self, TrainError> {
        let mut results = Self { runs: Vec::new(), missing: Vec::new() };
        for run in &manifest.runs {
            let path = folder.path(&run.name);
            if !is_finished(&path) {
                results.missing.push(missing(folder, run));
                continue;
            }
            let (run_folder, record, config) = RunFolder::open(&path)?;
            if config.digest_text() != run.configuration {
                let state = "has another configuration than the study planned".to_owned();
                let (run, task) = (run.name.clone(), run.task);
                results.missing.push(MissingRun { run, task, state, share: 0.0, seconds: 0.0 });
                continue;
            }
            let evaluation: EvaluationFile = run_folder
                .read_json("eval.json")?
                .ok_or_else(|| TrainError::Input(format!("{} has no eval.json", path.display())))?;
            let frames = light4gs_codec::read_info_with_limits(&run_folder.stream(), &light4gs_codec::Limits::large())
                .ok()
                .map(|info| info.meta.frame_count);
            let frames = frames.filter(|count| *count > 0);
            results.runs.push(result(run, &config, evaluation, frames, record.into()));
        }
        Ok(results)
    }

    /// The result of one run.
    pub fn get(&self, scene: usize, variant: usize, seed: u64) -> Option<&RunResult> {
        self.runs.iter().find(|run| (run.scene, run.variant, run.seed) == (scene, variant, seed))
    }

    /// The finished runs of a variant on a scene, one for each seed.
    pub fn of_variant(&self, scene: usize, variant: usize) -> impl Iterator<Item = &RunResult> {
        self.runs.iter().filter(move |run| (run.scene, run.variant) == (scene, variant))
    }

    /// `results.csv` (without times) or `times.csv` (only times).
    pub fn to_csv(&self, manifest: &Manifest, times: bool) -> String {
        let variants = manifest.variants();
        let measures: Vec<Measure> =
            Measure::ALL.iter().copied().filter(|measure| measure.is_time() == times).collect();
        let mut heading = vec!["scene".to_owned()];
        heading.extend(manifest.study.axis.iter().map(|axis| axis.name.clone()));
        heading.push("seed".to_owned());
        heading.extend(measures.iter().map(ToString::to_string));
        let mut text = line(heading);
        for run in &self.runs {
            let mut cells = vec![manifest.scenes[run.scene].name.clone()];
            let values = manifest.study.axis.iter().zip(&variants[run.variant].values);
            cells.extend(values.map(|(axis, value)| axis.value[*value].name.clone()));
            cells.push(run.seed.to_string());
            cells.extend(measures.iter().map(|measure| measure.of(run).map_or_else(String::new, |v| v.to_string())));
            text += &line(cells);
        }
        text
    }
}

fn line(cells: Vec<String>) -> String {
    let quoted = |cell: String| {
        if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell }
    };
    let mut text = cells.into_iter().map(quoted).collect::<Vec<_>>().join(",");
    text.push('\n');
    text
}

fn result(
    run: &ManifestRun,
    config: &Config,
    evaluation: EvaluationFile,
    frames: Option<u32>,
    trained: Training,
) -> RunResult {
    let split = |name: &str| evaluation.splits.iter().find(|split| split.split == name);
    let shown = split("test").or(evaluation.splits.first());
    let coding = evaluation.coding.as_ref();
    RunResult {
        run: run.name.clone(),
        scene: run.scene,
        variant: run.variant,
        seed: run.seed,
        configuration: run.configuration.clone(),
        quality: shown.map(|split| split.quality).unwrap_or_default(),
        val_psnr: split("val").and_then(|split| split.quality.psnr),
        bytes: evaluation.bytes,
        sections: evaluation.sections.iter().map(|section| (section.name.clone(), section.bytes)).collect(),
        gaussians: evaluation.gaussians,
        resolution: evaluation.resolution,
        background: config.data.background,
        frames,
        steps: coding.map(|coding| coding.planes.iter().map(|p| p.step.into()).collect()).unwrap_or_default(),
        training_seconds: evaluation.training_seconds,
        fit_seconds: coding.and_then(|coding| coding.fit_seconds),
        encode_seconds: coding.map(|coding| coding.encode_seconds),
        decode_seconds: evaluation.decode_seconds,
        fps: evaluation.fps.unwrap_or(f64::NAN),
        device: evaluation.device,
        trained,
    }
}

/// A run that is not finished.
fn missing(folder: &StudyFolder, run: &ManifestRun) -> MissingRun {
    let path = folder.path(&run.name);
    let last = read_metrics(&path.join("metrics.jsonl")).ok().and_then(|records| records.last().cloned());
    let share = last.as_ref().zip(folder.config_of(run).ok()).map_or(0.0, |(record, config)| {
        let train = &config.train;
        let before = if record.stage == Stage::Fine { train.coarse_iterations } else { 0 };
        let whole = train.coarse_iterations + train.fine_iterations;
        (before + record.iteration) as f64 / whole.max(1) as f64
    });
    let seconds = last.as_ref().map_or(0.0, |record| record.seconds);
    let state = state(folder, run, last);
    MissingRun { run: run.name.clone(), task: run.task, state, share, seconds }
}

/// Its state in words.
fn state(folder: &StudyFolder, run: &ManifestRun, last: Option<MetricsRecord>) -> String {
    let path = folder.path(&run.name);
    let mut state = match last {
        _ if path.join("scene.l4gs").is_file() => "trained, not measured".to_owned(),
        Some(record) => format!("{} stage, iteration {}", record.stage, record.iteration),
        None if path.join("run.json").is_file() => "begun".to_owned(),
        None => "not begun".to_owned(),
    };
    if let Ok(failure) = light4gs_data::read_regular_text(&folder.failure(run.task), 1 << 20) {
        state += &format!("; its task failed: {}", failure.trim());
    }
    state
}
