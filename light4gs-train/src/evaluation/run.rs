//! Measuring the file of a finished run: `eval.json` and `renders/` are written.

use std::fs;

use light4gs_codec::Limits;
use light4gs_data::{DataError, Scene, Split};
use light4gs_model::DeformationField;

use super::advice::advice;
use super::{DecodedScene, Evaluation, RenderedView};
use crate::config::Config;
use crate::corrections::{Corrections, Schedule};
use crate::dataset::image_store;
use crate::device::{self, describe};
use crate::error::TrainError;
use crate::observers::metrics_log::read_metrics;
use crate::run::RunFolder;
use crate::take::backdrop_of;

/// Measures the run's file on its own dataset, and writes `eval.json` and, where the configuration asks for them, the
/// rendered views. Returns the results and the views.
///
/// # Errors
/// - [`TrainError::Input`] for a device that this machine does not have, or a damaged record of the run
/// - as [`DecodedScene::open`] for the run's file, and as [`DecodedScene::evaluate`] for images
/// - [`TrainError::Data`] for a folder in which nothing can be written
pub fn measure_run<F: DeformationField>(
    folder: &RunFolder,
    config: &Config,
    scene: &Scene,
) -> Result<(Evaluation, Vec<RenderedView>), TrainError> {
    let device = device::open(config.device)?;
    let mut decoded = DecodedScene::<F>::open_with_limits(&folder.stream(), &Limits::large(), &device)?;
    decoded.backdrop = backdrop_of(config, folder, &device)?;
    let images = image_store(config);
    let fit = Corrections::new(&config.train.corrections, scene, Schedule::default()).fit();
    let name = describe(config.device, &device);
    let (mut evaluation, views) = decoded.evaluate(scene, &images, &config.eval, fit.as_ref(), &name)?;
    let metrics = read_metrics(&folder.path("metrics.jsonl"))?;
    evaluation.training_seconds = metrics.last().map(|record| record.seconds);
    if let Some(test) = evaluation.splits.iter().find(|split| split.split == Split::Test.name()) {
        let faults = folder.capture()?.unwrap_or_default().faults;
        evaluation.advice = advice(config, test.scores.psnr(), &metrics, faults);
    }
    evaluation.coding = folder.read_json("coding.json")?;
    folder.write_json("eval.json", &evaluation)?;
    if config.eval.save_renders {
        save_renders(folder, &views)?;
    }
    Ok((evaluation, views))
}

fn save_renders(folder: &RunFolder, views: &[RenderedView]) -> Result<(), TrainError> {
    for view in views {
        let path = folder.path("renders").join(view.split.name());
        fs::create_dir_all(&path).map_err(|source| DataError::Io { action: "create", path: path.clone(), source })?;
        view.render.save_png(&path.join(format!("{}.png", view.name)))?;
    }
    Ok(())
}
