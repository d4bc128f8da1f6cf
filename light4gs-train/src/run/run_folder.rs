//! The folder of a run: `config.toml`, `run.json`, `dataset.json`, `metrics.jsonl`, `checkpoints/`, `scene.l4gs`,
//! `eval.json`, `renders/`, `report.html`.
//!
//! `run.json` is written last when a run is made, and removed first when it is replaced: if it exists, the rest is
//! complete. A run whose process was killed can be continued, or begun again (see [`contents`](super::contents)).

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use light4gs_data::{CaptureSummary, DataError, DatasetDigest, Scene, read_regular_file, write_atomically};
use serde::{Deserialize, Serialize};

use super::contents::{self, Contents, DATASET, FILES, FOLDERS, RECORD};
use super::list_checkpoints;
use super::lock::RunLock;
use crate::config::Config;
use crate::error::TrainError;
use crate::provenance::{self, COMMIT};
use crate::utc;

/// JSON files of a run are far shorter.
const MAX_JSON_BYTES: u64 = 1 << 30;

/// The path of a run's scene, kept beside the configuration so that `resume` and `eval` need no arguments, and the
/// provenance of the run.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// Absolute path of the dataset; an imported run may have none.
    pub scene: Option<PathBuf>,
    /// Version of the program that began the run.
    pub version: String,
    /// Commit from which it was built, with the suffix `-dirty` if files had been changed; `unknown` outside of the
    /// repository.
    #[serde(default)]
    pub commit: String,
    /// Device on which the run began.
    #[serde(default)]
    pub device: String,
    /// Processor and cores of the machine on which it began.
    #[serde(default)]
    pub machine: String,
    /// Threads with which it began.
    #[serde(default)]
    pub threads: usize,
    /// When it began, UTC.
    #[serde(default)]
    pub begun: String,
    /// SHA-256 of the configuration with which it began.
    #[serde(default)]
    pub configuration: String,
    /// What the dataset was taken for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capture: Option<CaptureSummary>,
    /// If this run only wrote the file: the record of the run that trained it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trained_by: Option<Box<RunRecord>>,
}

impl RunRecord {
    /// A record for this dataset, or for none.
    ///
    /// # Errors
    /// [`TrainError::Input`] if the path is not Unicode, which JSON cannot hold.
    pub fn new(scene: Option<&Path>, config: &Config) -> Result<Self, TrainError> {
        let scene = scene.map(absolute).transpose()?;
        Ok(Self {
            scene,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: COMMIT.to_owned(),
            device: crate::device::chosen(config.device).to_string(),
            machine: provenance::machine(),
            threads: rayon::current_num_threads(),
            begun: utc::now(),
            configuration: config.digest_text(),
            capture: None,
            trained_by: None,
        })
    }

    /// The dataset.
    ///
    /// # Errors
    /// [`TrainError::Input`] if the run has none.
    pub fn dataset(&self) -> Result<&Path, TrainError> {
        self.scene.as_deref().ok_or_else(|| {
            let remedy = "name one with `light4gs eval RUN --scene DIR`, or import it anew with --scene";
            TrainError::Input(format!("this run was imported without a dataset; {remedy}"))
        })
    }
}

/// The absolute path, which JSON must be able to hold.
fn absolute(scene: &Path) -> Result<PathBuf, TrainError> {
    let scene = fs::canonicalize(scene).map_err(DataError::io("read", scene))?;
    if scene.to_str().is_none() {
        return Err(TrainError::Input(format!(
            "the dataset's path {} is not valid Unicode, so that {RECORD} cannot hold it; rename the folder, or link to it",
            scene.display()
        )));
    }
    Ok(scene)
}

/// Paths of a run. A folder that is written to is locked, by [`RunFolder::create`] or [`RunFolder::lock`]. The lock is
/// held until the last copy is dropped.
#[derive(Clone, Debug)]
pub struct RunFolder {
    root: PathBuf,
    lock: Option<RunLock>,
}

impl RunFolder {
    /// Makes a folder for a new run, and locks it.
    ///
    /// # Errors
    /// [`TrainError::RunExists`] if it holds a run and `overwrite` is not set; [`TrainError::RunInUse`] if another process
    /// writes into it; [`TrainError::Input`] if it holds anything else.
    pub fn create(root: &Path, scene: Option<&Path>, config: &Config, overwrite: bool) -> Result<Self, TrainError> {
        let record = RunRecord::new(scene, config)?;
        let mut folder = Self { root: root.to_owned(), lock: None };
        // Checked before the lock is taken, since its file marks the folder as one of ours.
        folder.allow_new_run(overwrite)?;
        fs::create_dir_all(root).map_err(DataError::io("create", root))?;
        folder.lock()?;
        // Checked again with the lock: meanwhile another process may have begun a run here.
        if folder.allow_new_run(overwrite)? != Contents::Nothing {
            folder.clear()?;
        }
        let checkpoints = folder.checkpoints();
        fs::create_dir_all(&checkpoints).map_err(DataError::io("create", &checkpoints))?;
        folder.write("config.toml", config.to_toml().as_bytes())?;
        folder.write_json(RECORD, &record)?;
        Ok(folder)
    }

    /// Adds to the run's record what its dataset is taken for.
    ///
    /// # Errors
    /// [`TrainError`] if the record cannot be read or written.
    pub fn record_capture(&self, capture: CaptureSummary) -> Result<(), TrainError> {
        let record: RunRecord = read_json(&self.path(RECORD))?;
        self.write_json(RECORD, &RunRecord { capture: Some(capture), ..record })
    }

    /// What the run's dataset was taken for when the run began; `None` where that was not recorded.
    ///
    /// # Errors
    /// [`TrainError`] if the record is damaged.
    pub fn capture(&self) -> Result<Option<CaptureSummary>, TrainError> {
        Ok(self.read_json::<RunRecord>(RECORD)?.and_then(|record| record.capture))
    }

    /// Refuses a folder in which no new run may be made; returns its contents.
    fn allow_new_run(&self, overwrite: bool) -> Result<Contents, TrainError> {
        let root = self.root.display();
        let found = contents::of(&self.root)?;
        match found {
            Contents::Nothing | Contents::AbandonedStart => Ok(found),
            Contents::Run | Contents::Remains if overwrite => Ok(found),
            Contents::Run => Err(TrainError::RunExists(self.root.clone())),
            Contents::Remains => Err(TrainError::Input(format!(
                "{root} holds what is left of a run whose {RECORD} is gone; give --overwrite to replace it"
            ))),
            Contents::Foreign(name) => Err(TrainError::Input(format!(
                "{root} holds files but no run, among them `{name}`; name another folder (--overwrite replaces runs only)"
            ))),
        }
    }

    /// Removes the files of a run, and nothing else.
    fn clear(&self) -> Result<(), TrainError> {
        FILES.iter().chain(&FOLDERS).try_for_each(|name| remove(&self.path(name)))
    }

    /// Opens the folder of a run for reading; see [`RunFolder::lock`].
    ///
    /// # Errors
    /// [`TrainError::Input`] if there is no run, or if its record or configuration is damaged.
    pub fn open(root: &Path) -> Result<(Self, RunRecord, Config), TrainError> {
        let folder = Self { root: root.to_owned(), lock: None };
        let path = folder.path(RECORD);
        let shown = root.display();
        let anew = format!("light4gs train DATASET --out {shown}");
        match contents::of(root)? {
            Contents::Run => {}
            Contents::AbandonedStart => {
                return Err(TrainError::Input(format!(
                    "{shown} has no {RECORD}: the run was stopped before it began. Begin it with `{anew}`"
                )));
            }
            Contents::Remains => {
                return Err(TrainError::Input(format!(
                    "{shown} has no {RECORD}: it holds what is left of a run. Replace it with `{anew} --overwrite`"
                )));
            }
            Contents::Nothing | Contents::Foreign(_) => {
                return Err(TrainError::Input(format!("{shown} is not the folder of a run: it has no {RECORD}")));
            }
        }
        let record = read_json(&path).map_err(|error| match error {
            DataError::Json { source, .. } => TrainError::Input(format!(
                "{} is damaged: {source}. It holds \"scene\", the dataset's absolute path, and \"version\": write it anew, \
                 or replace the run with `{anew} --overwrite`",
                path.display()
            )),
            other => other.into(),
        })?;
        let config = Config::from_file(folder.path("config.toml"))?;
        Ok((folder, record, config))
    }

    /// Makes sure that only this process writes into the folder, and removes temporary files of killed processes. Does
    /// nothing if this value has locked the folder already.
    ///
    /// # Errors
    /// [`TrainError::RunInUse`] with the process that holds the lock.
    pub fn lock(&mut self) -> Result<(), TrainError> {
        if self.lock.is_none() {
            self.lock = Some(RunLock::take(&self.root)?);
            contents::sweep(&self.root);
        }
        Ok(())
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

    /// Copies the newest checkpoint and the log of another run, to continue from there, and records which run trained
    /// it. Does nothing if that run's dataset differs from this one.
    ///
    /// # Errors
    /// [`TrainError::Input`] if the other folder holds no run; [`TrainError::Data`] for a file that cannot be read or written.
    pub fn adopt(&self, other: &Path, data: &Scene) -> Result<(), TrainError> {
        let (other, trained_by, _) = Self::open(other)?;
        let dataset: Option<DatasetDigest> = other.read_json(DATASET)?;
        let now = DatasetDigest::of(data)?;
        if dataset.is_none_or(|before| !now.changes_since(&before).is_empty()) {
            return Ok(());
        }
        let mut record: RunRecord = read_json(&self.path(RECORD))?;
        record.trained_by = Some(trained_by.trained_by.clone().unwrap_or_else(|| Box::new(trained_by)));
        self.write_json(RECORD, &record)?;
        let checkpoint = other.last_checkpoint().map(|from| {
            let to = self.checkpoints().join(from.file_name().expect("a checkpoint is a file"));
            (from, to)
        });
        let log = (other.path("metrics.jsonl"), self.path("metrics.jsonl"));
        for (from, to) in checkpoint.into_iter().chain([log]) {
            // Whole or not at all: with half a checkpoint the run could not be resumed.
            let bytes = read_regular_file(&from, u64::MAX).map_err(DataError::io("read", &from))?;
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

    /// Writes a file of the folder, whole or not at all.
    ///
    /// # Errors
    /// [`TrainError::Data`] naming the file that cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        let path = self.path(name);
        Ok(write_atomically(&path, |file| file.write_all(bytes))?)
    }

    /// Compares the dataset with the one with which the run began, and stores its digest: the first time, and when it
    /// may have changed.
    ///
    /// # Errors
    /// [`TrainError::Input`] with the changes, unless `accept` is set; an image file that cannot be read.
    pub fn check_dataset(&self, data: &Scene, accept: bool) -> Result<(), TrainError> {
        let now = DatasetDigest::of(data)?;
        let remedy = "remove the file to go on with the dataset as it is";
        if let Some(before) = self.read_described(DATASET, remedy)?.filter(|_| !accept) {
            let changes = now.changes_since(&before);
            if changes.is_empty() {
                return Ok(());
            }
            let run = self.root.display();
            return Err(TrainError::Input(format!(
                "the dataset {} has changed since the run {run} began: {}. Restore it, or go on with the changed dataset by \
                 `light4gs resume {run} --accept-changed-dataset`",
                data.root.display(),
                changes.join("; ")
            )));
        }
        self.write_json(DATASET, &now)
    }

    /// Reads a JSON file of the run that `resume` writes; `None` if it does not exist.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a damaged file; [`TrainError::Data`] for one that cannot be read.
    pub fn read_json<T: serde::de::DeserializeOwned>(&self, name: &str) -> Result<Option<T>, TrainError> {
        self.read_described(name, &format!("`light4gs resume {}` writes it anew", self.root.display()))
    }

    fn read_described<T: serde::de::DeserializeOwned>(
        &self,
        name: &str,
        remedy: &str,
    ) -> Result<Option<T>, TrainError> {
        let path = self.path(name);
        match read_json(&path) {
            Ok(value) => Ok(Some(value)),
            Err(DataError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(DataError::Json { source, .. }) => {
                Err(TrainError::Input(format!("{} is damaged: {source}; {remedy}", path.display())))
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Writes a value as indented JSON, whole or not at all.
    ///
    /// # Errors
    /// As [`RunFolder::write`].
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), TrainError> {
        let mut text = serde_json::to_string_pretty(value).expect("plain data has a JSON form");
        text.push('\n');
        self.write(name, text.as_bytes())
    }
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, DataError> {
    let bytes = read_regular_file(path, MAX_JSON_BYTES).map_err(DataError::io("read", path))?;
    serde_json::from_slice(&bytes).map_err(|source| DataError::Json { path: path.to_owned(), source })
}

/// Removes a file or a folder, if it is there.
fn remove(path: &Path) -> Result<(), TrainError> {
    // A link is removed itself, not its target, even if the target does not exist.
    let removed = match path.symlink_metadata() {
        Ok(metadata) if metadata.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(_) => Ok(()),
    };
    Ok(removed.map_err(DataError::io("remove", path))?)
}
