//! Messages to the page while a scene is trained.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use burn::tensor::Tensor;
use image::{ImageFormat, RgbImage};
use light4gs_data::DataError;
use light4gs_train::Stage;
use light4gs_train::error::TrainError;
use light4gs_train::observers::metrics_log::MetricsRecord;
use light4gs_train::observers::{Observer, SceneInTraining, StepReport};
use light4gs_train::view_source::ViewSource;
use serde_json::{Value, json};

use crate::messages::say;

/// Time between two pictures.
const PICTURE_INTERVAL: Duration = Duration::from_secs(1);

/// Turns the calls of a trainer into messages, with pictures and scenes in files beside the run's folder.
pub(crate) struct Messages {
    run: PathBuf,
    source: Option<ViewSource>,
    pictured: Option<Instant>,
}

impl Messages {
    /// For the run in this folder.
    pub(crate) fn new(run: &Path) -> Self {
        Self { run: run.to_owned(), source: None, pictured: None }
    }
}

impl Observer for Messages {
    fn on_stage(&mut self, stage: Stage, _done: usize, iterations: usize) -> Result<(), TrainError> {
        say(&json!({ "kind": "stage", "stage": stage, "iterations": iterations }));
        Ok(())
    }

    fn on_step(&mut self, step: &StepReport, _scene: &dyn SceneInTraining) -> Result<(), TrainError> {
        if self.pictured.is_some_and(|last| last.elapsed() < PICTURE_INTERVAL) {
            return Ok(());
        }
        let file = self.run.with_extension("png");
        write(&file, &picture([&step.image, &step.truth]))?;
        self.pictured = Some(Instant::now());
        say(&json!({ "kind": "picture", "file": file }));
        Ok(())
    }

    fn on_log(&mut self, record: &MetricsRecord) -> Result<(), TrainError> {
        let mut message = serde_json::to_value(record).unwrap_or(Value::Null);
        message["kind"] = "log".into();
        say(&message);
        Ok(())
    }

    fn on_checkpoint(&mut self, _path: &Path) -> Result<(), TrainError> {
        let source = match &mut self.source {
            Some(source) => source,
            empty => empty.insert(ViewSource::run(&self.run, None)?),
        };
        let (file, shown) = (self.run.with_extension("l4gs"), source.refresh());
        write(&file, &shown.bytes)?;
        say(&json!({ "kind": "scene", "file": file, "status": shown.status }));
        Ok(())
    }

    fn on_warning(&mut self, warning: &str) -> Result<(), TrainError> {
        say(&json!({ "kind": "warning", "text": warning }));
        Ok(())
    }

    fn on_fit(&mut self, done: usize, iterations: usize) -> Result<(), TrainError> {
        say(&json!({ "kind": "fit", "done": done, "iterations": iterations }));
        Ok(())
    }
}

/// Images `[H, W, 3]` of one size, side by side, as PNG.
fn picture(images: [&Tensor<3>; 2]) -> Vec<u8> {
    let both = Tensor::cat(images.map(Clone::clone).to_vec(), 1);
    let [height, width, _] = both.dims();
    let bytes = both.clamp(0.0, 1.0).into_data().iter::<f32>().map(|value| (255.0 * value).round() as u8).collect();
    let mut png = Cursor::new(Vec::new());
    if let Some(image) = RgbImage::from_raw(width as u32, height as u32, bytes) {
        image.write_to(&mut png, ImageFormat::Png).expect("memory takes a PNG");
    }
    png.into_inner()
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), TrainError> {
    Ok(std::fs::write(path, bytes).map_err(DataError::io("write", path))?)
}
