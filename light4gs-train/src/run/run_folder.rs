//! The folder of a run: `config.toml`, `run.json`, `metrics.jsonl`, `events/`, `checkpoints/`, `scene.l4gs`,
//! `eval.json`, `renders/`, `report.html`.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use light4gs_data::{DataError, write_atomically};
use serde::{Deserialize, Serialize};

use super::list_checkpoints;
use crate::config::Config;
use crate::error::TrainError;

/// Files of a run; `--overwrite` removes them.
const FILES: [&str; 8] = [
    "run.json",
    "config.toml",
    "metrics.jsonl",
    "scene.l4gs",
    "coding.json",
    "bit_maps.json",
    "eval.json",
    "report.html",
];

/// Where a run's scene is; kept beside the configuration so that `resume` and `eval` need no arguments.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// Absolute path of the dataset.
    pub scene: PathBuf,
    /// Version of the program that began the run.
    pub version: String,
}

/// Paths of a run.
#[derive(Clone, Debug)]
pub struct RunFolder {
    root: PathBuf,
}

fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> DataError {
    move |source| DataError::Io { action, path: path.to_owned(), source }
}

impl RunFolder {
    /// Makes a folder for a new run.
    ///
    /// # Errors
    /// [`TrainError::RunExists`] if it holds anything and `overwrite` is not set.
    pub fn create(root: &Path, scene: &Path, config: &Config, overwrite: bool) -> Result<Self, TrainError> {
        let folder = Self { root: root.to_owned() };
        let occupied = fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some());
        if occupied {
            if !overwrite {
                return Err(TrainError::RunExists(root.to_owned()));
            }
            if !folder.path("run.json").exists() {
                let root = root.display();
                return Err(TrainError::Input(format!(
                    "{root} holds files but no run; --overwrite replaces runs only"
                )));
            }
            for name in FILES {
                remove(&folder.path(name), |path| fs::remove_file(path))?;
            }
            for name in ["events", "checkpoints", "renders"] {
                remove(&folder.path(name), |path| fs::remove_dir_all(path))?;
            }
        }
        let checkpoints = folder.checkpoints();
        fs::create_dir_all(&checkpoints).map_err(io("create", &checkpoints))?;
        let scene = fs::canonicalize(scene).map_err(io("read", scene))?;
        let record = RunRecord { scene, version: env!("CARGO_PKG_VERSION").to_owned() };
        folder.write("config.toml", config.to_toml().as_bytes())?;
        folder.write_json("run.json", &record)?;
        Ok(folder)
    }

    /// Opens the folder of a run.
    ///
    /// # Errors
    /// [`TrainError::Input`] if there is none.
    pub fn open(root: &Path) -> Result<(Self, RunRecord, Config), TrainError> {
        let folder = Self { root: root.to_owned() };
        let path = folder.path("run.json");
        if !path.exists() {
            return Err(TrainError::Input(format!(
                "{} is not the folder of a run: it has no run.json",
                root.display()
            )));
        }
        let text = fs::read_to_string(&path).map_err(io("read", &path))?;
        let record = serde_json::from_str(&text).map_err(|source| DataError::Json { path, source })?;
        let config = Config::from_file(folder.path("config.toml"))?;
        Ok((folder, record, config))
    }

    /// A path inside the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where checkpoints lie.
    pub fn checkpoints(&self) -> PathBuf {
        self.path("checkpoints")
    }

    /// Takes over the newest checkpoint and the log of another run, to go on from there.
    pub fn adopt(&self, other: &Self) -> Result<(), TrainError> {
        let log = other.path("metrics.jsonl");
        let checkpoint = other.last_checkpoint().map(|from| {
            let to = self.checkpoints().join(from.file_name().expect("a checkpoint is a file"));
            (from, to)
        });
        for (from, to) in checkpoint.into_iter().chain([(log, self.path("metrics.jsonl"))]) {
            // Whole or not at all: half a checkpoint would stop the run from being resumed.
            let bytes = fs::read(&from).map_err(io("read", &from))?;
            write_atomically(&to, |file| file.write_all(&bytes))?;
        }
        Ok(())
    }

    /// The newest checkpoint.
    pub fn last_checkpoint(&self) -> Option<PathBuf> {
        list_checkpoints(&self.checkpoints()).pop()
    }

    /// The compressed scene.
    pub fn stream(&self) -> PathBuf {
        self.path("scene.l4gs")
    }

    /// Writes a file whole or not at all.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        let path = self.path(name);
        Ok(write_atomically(&path, |file| file.write_all(bytes))?)
    }

    /// Reads a JSON file of the run; nothing if it is not there.
    pub fn read_json<T: serde::de::DeserializeOwned>(&self, name: &str) -> Result<Option<T>, TrainError> {
        let path = self.path(name);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(io("read", &path)(error).into()),
        };
        Ok(Some(serde_json::from_str(&text).map_err(|source| DataError::Json { path, source })?))
    }

    /// Writes pretty JSON.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), TrainError> {
        let mut text = serde_json::to_string_pretty(value).expect("plain data has a JSON form");
        text.push('\n');
        self.write(name, text.as_bytes())
    }
}

fn remove(path: &Path, remove: impl FnOnce(&Path) -> std::io::Result<()>) -> Result<(), TrainError> {
    if path.exists() { remove(path).map_err(io("remove", path)).map_err(Into::into) } else { Ok(()) }
}
