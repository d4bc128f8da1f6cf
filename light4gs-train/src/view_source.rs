//! The scene that a viewer shows: a file, or the newest state of a run.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use burn::tensor::Device;
use light4gs_codec::read_info;
use light4gs_data::{DataError, Scene};

use crate::compression::ConfiguredModels;
use crate::config::{Config, DeviceName};
use crate::dataset::{load_options, scene_meta};
use crate::device;
use crate::error::TrainError;
use crate::run::{Checkpoint, RunFolder};

/// A scene that may change while it is shown.
#[derive(Debug)]
pub struct ViewSource {
    kind: Kind,
    /// The file from which `bytes` were made, and its time of modification.
    shown: Option<(PathBuf, SystemTime)>,
    /// A `.l4gs` stream.
    bytes: Vec<u8>,
    /// Number of changes of the scene.
    version: u64,
    status: String,
}

#[derive(Debug)]
enum Kind {
    File(PathBuf),
    Run(Box<Run>),
}

#[derive(Debug)]
struct Run {
    folder: RunFolder,
    config: Config,
    dataset: Scene,
    device: Device,
}

impl ViewSource {
    /// A `.l4gs` file.
    ///
    /// # Errors
    /// [`TrainError::Codec`] for a file that is damaged, or cannot be read.
    pub fn file(path: &Path) -> Result<Self, TrainError> {
        read_info(path)?;
        Self::new(Kind::File(path.to_owned()))
    }

    /// A run: its newest checkpoint while it trains, and its file when that has been written.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a folder without a run, or a device that this machine does not have;
    /// [`TrainError::Data`] for a dataset that cannot be read.
    pub fn run(root: &Path, device: Option<DeviceName>) -> Result<Self, TrainError> {
        let (folder, record, config) = RunFolder::open(root)?;
        let device = device::open(device.unwrap_or(config.device))?.autodiff();
        let dataset = Scene::open(record.dataset()?, &load_options(&config))?;
        Self::new(Kind::Run(Box::new(Run { folder, config, dataset, device })))
    }

    fn new(kind: Kind) -> Result<Self, TrainError> {
        let mut source = Self { kind, shown: None, bytes: Vec::new(), version: 0, status: String::new() };
        source.refresh()?;
        Ok(source)
    }

    /// Looks for a newer state, and reads it.
    ///
    /// # Errors
    /// [`TrainError::Data`] for a file, [`TrainError::Checkpoint`] for a checkpoint that cannot be read. The state shown before
    /// is kept.
    pub fn refresh(&mut self) -> Result<(), TrainError> {
        let newest = match &self.kind {
            Kind::File(path) => Some(path.clone()),
            Kind::Run(run) => run.newest(),
        };
        let Some(path) = newest else {
            self.status = "Waiting for the first checkpoint".into();
            return Ok(());
        };
        let io = |source| DataError::Io { action: "read", path: path.clone(), source };
        let written = std::fs::metadata(&path).and_then(|data| data.modified()).map_err(io)?;
        let seen = Some((path.clone(), written));
        if seen == self.shown {
            return Ok(());
        }
        (self.bytes, self.status) = match &self.kind {
            Kind::Run(run) if path != run.folder.stream() => run.encode(&path)?,
            _ => (std::fs::read(&path).map_err(io)?, String::new()),
        };
        self.shown = seen;
        self.version += 1;
        Ok(())
    }

    /// The scene as a `.l4gs` stream; empty before there is one.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Number of changes of the scene; 0 as long as there is none.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// The training position; empty if nothing is being trained.
    pub fn status(&self) -> &str {
        &self.status
    }

    /// The dataset, if it is known.
    pub fn dataset(&self) -> Option<&Scene> {
        match &self.kind {
            Kind::File(_) => None,
            Kind::Run(run) => Some(&run.dataset),
        }
    }

    /// A name for the page.
    pub fn title(&self) -> String {
        let path = match &self.kind {
            Kind::File(path) => path,
            Kind::Run(run) => run.folder.root(),
        };
        path.file_name().map_or_else(|| "Scene".into(), |name| name.to_string_lossy().into_owned())
    }
}

impl Run {
    /// The run's file, or the checkpoint that is newer than it.
    fn newest(&self) -> Option<PathBuf> {
        let time = |path: &PathBuf| std::fs::metadata(path).and_then(|data| data.modified()).ok();
        let stream = Some(self.folder.stream()).filter(|path| path.exists());
        let checkpoint = self.folder.last_checkpoint();
        match (&stream, &checkpoint) {
            (Some(file), Some(newest)) if time(newest) > time(file) => checkpoint,
            (Some(_), _) => stream,
            (None, _) => checkpoint,
        }
    }

    /// A checkpoint as a stream without loss, and its training position as text.
    fn encode(&self, path: &Path) -> Result<(Vec<u8>, String), TrainError> {
        let checkpoint: Checkpoint =
            Checkpoint::load(path, &self.config, &self.config.model.build(), &ConfiguredModels, &self.device)?;
        let data = checkpoint.scene.to_arrays(scene_meta(&self.config, &self.dataset))?;
        let status = format!("{} stage, iteration {}", checkpoint.stage.name(), checkpoint.iteration);
        Ok((light4gs_codec::encode(&data)?, status))
    }
}
