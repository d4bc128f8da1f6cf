//! The report of a finished run: its file is measured, and the page written.

use std::io::ErrorKind;

use light4gs_data::{CaptureSummary, DataError, Region, Scene, read_regular_file};
use light4gs_model::DeformationField;
use light4gs_train::compression::BitMap;
use light4gs_train::config::Config;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::{Evaluation, measure_run};
use light4gs_train::metrics::{Metric, RegionMetric};
use light4gs_train::observers::metrics_log::read_metrics;
use light4gs_train::run::RunFolder;
use light4gs_train::utc;

use crate::{CodingReport, PlayerReport, Report, SummaryTile, cameras_json, write_report};

/// Number of views in a report.
const REPORT_VIEWS: usize = 6;
/// Number of cameras of each split in the player of a report.
const PLAYER_CAMERAS: usize = 60;
/// Size in bytes of the largest file that a report plays.
const LARGEST_PLAYED_FILE: u64 = 16 << 20;

/// Measures the run's file on its own dataset and writes everything that depends on it: `eval.json` and the renders, as
/// [`measure_run`] does, then `report.html`.
///
/// # Errors
/// As [`measure_run`]; a record of the run that is damaged; a page that cannot be written.
pub fn evaluate_run<F: DeformationField>(
    folder: &RunFolder,
    config: &Config,
    scene: &Scene,
) -> Result<Evaluation, TrainError> {
    let (evaluation, views) = measure_run::<F>(folder, config, scene)?;
    let report = Report {
        title: scene.name.clone(),
        created: utc::now_to_the_minute(),
        device: evaluation.device.clone(),
        summary: summary(&evaluation),
        advice: evaluation.advice.clone(),
        capture: folder.capture()?.map_or_else(|| CaptureSummary::of(scene), Ok)?,
        sections: evaluation.sections.clone(),
        player: player(folder, scene)?,
        coding: match &evaluation.coding {
            Some(record) => {
                let bit_maps: Vec<BitMap> = folder.read_json("bit_maps.json")?.unwrap_or_default();
                if let Some(problem) = bit_maps.iter().find_map(BitMap::problem) {
                    return Err(TrainError::Input(format!(
                        "{} is damaged: {problem}. `light4gs resume {}` writes it anew",
                        folder.path("bit_maps.json").display(),
                        folder.root().display()
                    )));
                }
                Some(CodingReport { record: record.clone(), bit_maps })
            }
            None => None,
        },
        splits: evaluation.splits.clone(),
        images: {
            let stride = views.len().div_ceil(REPORT_VIEWS).max(1);
            views.iter().step_by(stride).cloned().collect()
        },
        metrics: read_metrics(&folder.path("metrics.jsonl"))?,
        config_toml: config.to_toml(),
    };
    write_report(&folder.path("report.html"), &report)?;
    Ok(evaluation)
}

/// The file for the report, unless it would make the page too large to send.
fn player(folder: &RunFolder, scene: &Scene) -> Result<Option<PlayerReport>, TrainError> {
    let path = folder.stream();
    match read_regular_file(&path, LARGEST_PLAYED_FILE) {
        Ok(bytes) => Ok(Some(PlayerReport { scene: bytes, cameras: cameras_json(scene, PLAYER_CAMERAS) })),
        Err(error) if error.kind() == ErrorKind::FileTooLarge => Ok(None),
        Err(error) => Err(DataError::io("read", &path)(error).into()),
    }
}

fn summary(evaluation: &Evaluation) -> Vec<SummaryTile> {
    let tile =
        |label: &str, value: String, hint: &str| SummaryTile { label: label.to_owned(), value, hint: hint.to_owned() };
    let mut tiles = Vec::new();
    for split in &evaluation.splits {
        let views = format!("mean over {} views of the decoded file", split.views.len());
        tiles.push(tile(&format!("{} PSNR", split.split), format!("{:.2} dB", split.scores.psnr()), &views));
        if let Some(fitted) = &split.fitted {
            let hint = "after a fit of each view's exposure, pose or time, as training views were compared";
            tiles.push(tile(&format!("{} PSNR, fitted", split.split), format!("{:.2} dB", fitted.psnr()), hint));
        }
        tiles.push(tile(&format!("{} SSIM", split.split), format!("{:.4}", split.scores.ssim()), &views));
        let of = |region| {
            let metric = Metric::Of(region, RegionMetric::Psnr);
            split.scores.get(metric).map(|value| format!("{} dB", metric.format(Some(value))))
        };
        if let (Some(moving), Some(still)) = (of(Region::Moving), of(Region::Still)) {
            let hint = format!("over all moving pixels of the views; what stands still has {still}");
            tiles.push(tile(&format!("{} PSNR, moving", split.split), moving, &hint));
        }
    }
    tiles.push(tile("File", format!("{:.2} MB", evaluation.bytes as f64 / 1e6), "bytes on disk / 10^6"));
    tiles.push(tile("Gaussians", evaluation.gaussians.to_string(), "in the file"));
    let size = format!("{}×{}, decoding excluded", evaluation.resolution[0], evaluation.resolution[1]);
    tiles.push(tile("Rendering", format!("{:.1} FPS", evaluation.fps), &size));
    if let Some(seconds) = evaluation.training_seconds {
        tiles.push(tile("Training", format!("{:.1} min", seconds / 60.0), "on this device"));
    }
    tiles
}
