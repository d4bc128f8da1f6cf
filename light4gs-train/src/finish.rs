//! What follows training: the decoded file is measured, and `eval.json`, `renders/` and `report.html` are written.

use std::fs;

use light4gs_data::{DataError, ImageStore, Scene};

use crate::config::Config;
use crate::device::device_by_name;
use crate::error::TrainError;
use crate::evaluation::{DecodedScene, Evaluation, RenderedView};
use crate::metrics_log::read_metrics;
use crate::report::{Report, SectionBytes, SummaryTile, write_report};
use crate::run_folder::RunFolder;
use crate::trainer::load_options;

/// Views a report shows.
const REPORT_VIEWS: usize = 6;

/// Measures the run's file on its own dataset and writes everything that depends on it.
pub fn evaluate_run(folder: &RunFolder, config: &Config, scene: &Scene) -> Result<Evaluation, TrainError> {
    let device = device_by_name(&config.device)?;
    let decoded = DecodedScene::open(&folder.stream(), &device)?;
    let images = ImageStore::new(&load_options(config), (config.data.memory_limit_mib << 20) as usize);
    let (mut evaluation, views) = decoded.evaluate(scene, &images, &config.eval, &config.device)?;
    let metrics = read_metrics(&folder.path("metrics.jsonl"))?;
    evaluation.training_seconds = metrics.last().map(|record| record.seconds);
    folder.write_json("eval.json", &evaluation)?;
    if config.eval.save_renders {
        save_renders(folder, &views)?;
    }
    let report = Report {
        title: scene.name.clone(),
        created: created(),
        device: config.device.clone(),
        summary: summary(&evaluation),
        sections: evaluation
            .sections
            .iter()
            .map(|section| SectionBytes { name: section.name.clone(), bytes: section.bytes })
            .collect(),
        splits: evaluation.report_splits(),
        pictures: {
            let stride = views.len().div_ceil(REPORT_VIEWS).max(1);
            views.iter().step_by(stride).map(RenderedView::picture).collect()
        },
        metrics,
        config_toml: config.to_toml(),
    };
    write_report(&folder.path("report.html"), &report)?;
    Ok(evaluation)
}

fn save_renders(folder: &RunFolder, views: &[RenderedView]) -> Result<(), TrainError> {
    for view in views {
        let path = folder.path("renders").join(view.split.name());
        fs::create_dir_all(&path).map_err(|source| DataError::Io { action: "create", path: path.clone(), source })?;
        view.render.save_png(&path.join(format!("{}.png", view.name)))?;
    }
    Ok(())
}

fn created() -> String {
    let seconds = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |d| d.as_secs());
    format!("{} UTC", civil_date(seconds))
}

/// `YYYY-MM-DD hh:mm` of Unix seconds (Hinnant, *chrono-Compatible Low-Level Date Algorithms*).
fn civil_date(seconds: u64) -> String {
    let days = (seconds / 86_400) as i64 + 719_468;
    let era = days.div_euclid(146_097);
    let day_of_era = days.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02}", seconds % 86_400 / 3600, seconds % 3600 / 60)
}

fn summary(evaluation: &Evaluation) -> Vec<SummaryTile> {
    let tile =
        |label: &str, value: String, hint: &str| SummaryTile { label: label.to_owned(), value, hint: hint.to_owned() };
    let mut tiles = Vec::new();
    for split in &evaluation.splits {
        let views = format!("mean over {} views of the decoded file", split.views.len());
        tiles.push(tile(&format!("{} PSNR", split.split), format!("{:.2} dB", split.psnr), &views));
        tiles.push(tile(&format!("{} SSIM", split.split), format!("{:.4}", split.ssim), &views));
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

#[cfg(test)]
mod tests {
    use super::civil_date;

    #[test]
    fn dates() {
        assert_eq!(civil_date(0), "1970-01-01 00:00");
        assert_eq!(civil_date(951_868_740), "2000-02-29 23:59");
        assert_eq!(civil_date(1_795_219_200), "2026-11-21 00:00");
    }
}
