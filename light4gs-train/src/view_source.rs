//! The scene that a viewer shows: a file, or the newest state of a run.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use burn::tensor::Device;
use light4gs_codec::{CodecError, Limits, read_stream};
use light4gs_data::{DataError, Scene};

use crate::compression::ConfiguredModels;
use crate::config::{Config, DeviceName};
use crate::dataset::{load_options, scene_meta};
use crate::device;
use crate::error::TrainError;
use crate::run::{Checkpoint, RunFolder};

/// A file that was written longer ago than this is not being written any more.
const SETTLED: Duration = Duration::from_secs(2);

/// A scene that may change while it is shown.
#[derive(Debug)]
pub struct ViewSource {
    kind: Kind,
    /// The file from which the scene was made.
    read: Option<Seen>,
    /// A file that was refused, and why. It is not read again.
    refused: Option<(Seen, String)>,
    /// The training position.
    position: String,
    shown: Shown,
}

/// What is shown.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// A `.l4gs` stream; empty before there is one.
    pub bytes: Arc<Vec<u8>>,
    /// Number of changes of the scene; 0 as long as there is none.
    pub version: u64,
    /// The training position, or why there is no newer scene; empty if nothing is being trained.
    pub status: String,
}

/// A state of a file.
#[derive(Clone, Debug, PartialEq)]
struct Seen {
    path: PathBuf,
    written: SystemTime,
    bytes: u64,
}

#[derive(Debug)]
enum Kind {
    File(PathBuf, Limits),
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
    /// A `.l4gs` file within limits.
    ///
    /// # Errors
    /// [`TrainError::Codec`] for a file that is damaged, or cannot be read.
    pub fn file(path: &Path, limits: &Limits) -> Result<Self, TrainError> {
        Self::new(Kind::File(path.to_owned(), *limits))
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
        let mut source = Self { kind, read: None, refused: None, position: String::new(), shown: Shown::default() };
        source.look()?;
        Ok(source)
    }

    /// Looks for a newer state, and reads it. What is shown stays as it is while there is no newer scene, or one that cannot be
    /// read: then the status says why.
    pub fn refresh(&mut self) -> &Shown {
        let problem = self.look().err().map(|error| error.to_string());
        self.shown.status = problem.unwrap_or_else(|| self.position.clone());
        &self.shown
    }

    /// As [`ViewSource::refresh`], with what is wrong.
    fn look(&mut self) -> Result<(), TrainError> {
        let newest = match &self.kind {
            Kind::File(path, _) => Some(path.clone()),
            Kind::Run(run) => run.newest(),
        };
        let Some(path) = newest else {
            self.position = "Waiting for the first checkpoint".into();
            return Ok(());
        };
        let found = std::fs::metadata(&path).map_err(DataError::io("read", &path))?;
        let written = found.modified().map_err(DataError::io("read", &path))?;
        let seen = Seen { path, written, bytes: found.len() };
        if self.read.as_ref() == Some(&seen) {
            return Ok(());
        }
        if let Some((_, problem)) = self.refused.as_ref().filter(|(refused, _)| *refused == seen) {
            return Err(TrainError::Input(problem.clone()));
        }
        let read = match &self.kind {
            Kind::Run(run) if seen.path != run.folder.stream() => run.encode(&seen.path),
            Kind::Run(_) => stream(&seen.path, &Limits::large()),
            Kind::File(_, limits) => stream(&seen.path, limits),
        };
        match read {
            Ok((bytes, position)) => {
                (self.shown.bytes, self.position) = (Arc::new(bytes), position);
                self.shown.version += 1;
                (self.read, self.refused) = (Some(seen), None);
                Ok(())
            }
            Err(error) => {
                // What the system refuses now it may give later, and a file may still be on its way.
                let later = matches!(error, TrainError::Codec(CodecError::Io { .. }) | TrainError::Data(_))
                    || written.elapsed().is_ok_and(|age| age < SETTLED);
                self.refused = (!later).then(|| (seen, error.to_string()));
                Err(error)
            }
        }
    }

    /// The dataset, if it is known.
    pub fn dataset(&self) -> Option<&Scene> {
        match &self.kind {
            Kind::File(..) => None,
            Kind::Run(run) => Some(&run.dataset),
        }
    }

    /// A name for the page.
    pub fn title(&self) -> String {
        let path = match &self.kind {
            Kind::File(path, _) => path,
            Kind::Run(run) => run.folder.root(),
        };
        path.file_name().map_or_else(|| "Scene".into(), |name| name.to_string_lossy().into_owned())
    }
}

/// The bytes of a file that is a stream to its last bit. A finished file has no training position.
fn stream(path: &Path, limits: &Limits) -> Result<(Vec<u8>, String), TrainError> {
    Ok((read_stream(path, limits)?.0, String::new()))
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

#[cfg(test)]
mod tests {
    use light4gs_codec::{SceneData, SceneMeta, encode};

    use super::*;

    fn named(name: &str) -> Vec<u8> {
        encode(&SceneData { meta: SceneMeta { name: name.into(), ..SceneMeta::default() }, ..SceneData::default() })
            .expect("a scene")
    }

    #[test]
    fn a_scene_stays_until_there_is_a_good_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.l4gs");
        let (first, second) = (named("first"), named("the second"));
        std::fs::write(&path, &first).expect("written");
        let mut source = ViewSource::file(&path, &Limits::default()).expect("a scene");
        let mut shows = |bytes: &[u8], version: u64, status: &str| {
            let Shown { bytes: found, version: number, status: said } = source.refresh().clone();
            assert_eq!((&found[..], number), (bytes, version), "{said}");
            assert!(if status.is_empty() { said.is_empty() } else { said.contains(status) }, "{said}");
        };
        shows(&first, 1, "");
        std::fs::write(&path, &second[..second.len() - 1]).expect("written");
        shows(&first, 1, "cut short");
        std::fs::write(&path, "no scene").expect("written");
        shows(&first, 1, "not a .l4gs stream");
        std::fs::remove_file(&path).expect("removed");
        shows(&first, 1, "cannot read");
        #[cfg(target_os = "linux")]
        {
            let pipe = std::process::Command::new("mkfifo").arg(&path).status().expect("a program");
            assert!(pipe.success());
            shows(&first, 1, "a pipe");
            std::fs::remove_file(&path).expect("removed");
            std::os::unix::fs::symlink("/dev/zero", &path).expect("a link");
            shows(&first, 1, "a device");
            std::fs::remove_file(&path).expect("removed");
        }
        std::fs::write(&path, &second).expect("written");
        shows(&second, 2, "");
        shows(&second, 2, "");
    }
}
