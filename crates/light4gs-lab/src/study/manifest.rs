//! `study.json`: the plan of a study's folder. Tasks and tables read only this, so that a study continues as it was
//! begun, on any machine.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use light4gs_data::{DataError, read_regular_file, read_regular_text, write_atomically};
use light4gs_train::config::{Config, MAX_CONFIG_BYTES};
use light4gs_train::error::TrainError;
use serde::{Deserialize, Serialize};

use super::definition::Study;
use super::plan::{Plan, Variant, variants};

/// The file in a study's folder.
pub const MANIFEST: &str = "study.json";
/// The folder with the runs' configurations, in a study's folder. No scene can have this name.
const CONFIGURATIONS: &str = ".configurations";
/// The folder with messages and logs of tasks, in a study's folder.
const LOGS: &str = ".logs";
/// Manifests are far shorter.
const MAX_BYTES: u64 = 1 << 28;

/// The plan of a study's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the program that planned it.
    pub version: String,
    /// The command that planned it; empty where it is not known.
    #[serde(default)]
    pub command: String,
    /// The definition of the study.
    pub study: Study,
    /// Name and absolute path of every dataset.
    pub scenes: Vec<ManifestScene>,
    /// Runs of each variant on each scene.
    pub seeds: u64,
    /// Every run.
    pub runs: Vec<ManifestRun>,
    /// Absolute paths of other studies. If one of their finished runs trained just as a run of this study would, its
    /// training is reused, not repeated.
    #[serde(default)]
    pub reuse: Vec<PathBuf>,
}

/// A dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestScene {
    /// Name of its folder.
    pub name: String,
    /// Absolute path.
    pub path: PathBuf,
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestRun {
    /// Its folder below the study's.
    pub name: String,
    /// Index of the scene.
    pub scene: usize,
    /// Index of the variant, in the order of the axes' product.
    pub variant: usize,
    /// Counted from 0.
    pub seed: u64,
    /// Runs of one task are trained once, by the first of them.
    pub task: usize,
    /// SHA-256 of the configuration.
    pub configuration: String,
    /// Name of the program's own training, if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<String>,
}

/// A study's folder.
#[derive(Clone, Debug)]
pub struct StudyFolder {
    root: PathBuf,
}

impl Manifest {
    /// From a plan.
    pub fn new(plan: &Plan) -> Self {
        let run = |run: &super::plan::PlannedRun| ManifestRun {
            name: run.name.clone(),
            scene: run.scene,
            variant: run.variant,
            seed: run.seed,
            task: run.task,
            configuration: run.config.digest_text(),
            training: run.training.clone(),
        };
        let scene =
            |scene: &super::plan::StudyScene| ManifestScene { name: scene.name.clone(), path: scene.path.clone() };
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: plan.command.clone(),
            study: plan.study.clone(),
            scenes: plan.scenes.iter().map(scene).collect(),
            seeds: plan.seeds,
            runs: plan.runs.iter().map(run).collect(),
            reuse: plan.reuse.clone(),
        }
    }

    /// The variants, to which runs refer by index.
    pub fn variants(&self) -> Vec<Variant> {
        variants(&self.study.axis)
    }

    /// Number of tasks.
    pub fn tasks(&self) -> usize {
        self.runs.iter().map(|run| run.task + 1).max().unwrap_or(0)
    }

    /// The runs of a task, the one that is trained first.
    pub fn task(&self, task: usize) -> impl Iterator<Item = &ManifestRun> {
        self.runs.iter().filter(move |run| run.task == task)
    }

    /// Whether every index and name is one that a plan could have. The file may come from anywhere.
    fn is_sound(&self) -> bool {
        let variants = self.variants();
        self.runs.iter().all(|run| {
            let (scene, variant) = (self.scenes.get(run.scene), variants.get(run.variant));
            let expected =
                scene.zip(variant).map(|(scene, variant)| format!("{}/{}/seed-{}", scene.name, variant.name, run.seed));
            let plain = scene.is_some_and(|scene| {
                !scene.name.is_empty() && scene.name != ".." && scene.name != "." && !scene.name.contains(['/', '\\'])
            });
            plain && expected.as_ref() == Some(&run.name) && run.task < self.runs.len() && run.seed < self.seeds
        })
    }
}

impl StudyFolder {
    /// Makes the folder for a plan, or continues one that holds the same study: with the same runs, or with more or
    /// fewer scenes and seeds.
    ///
    /// # Errors
    /// [`TrainError::Input`] if the folder holds something else.
    pub fn create(root: &Path, plan: &Plan) -> Result<(Self, Manifest), TrainError> {
        let folder = Self { root: root.to_owned() };
        let manifest = Manifest::new(plan);
        match folder.manifest() {
            Ok(found) => folder.check_same(&found, &manifest)?,
            Err(_) if !folder.path(MANIFEST).exists() => folder.check_empty()?,
            Err(error) => return Err(error),
        }
        for run in &plan.runs {
            let path = folder.configuration(&run.name);
            let parent = path.parent().expect("a file in a folder");
            fs::create_dir_all(parent).map_err(DataError::io("create", parent))?;
            write_atomically(&path, |file| file.write_all(run.config.to_toml().as_bytes()))?;
        }
        let logs = folder.path(LOGS);
        fs::create_dir_all(&logs).map_err(DataError::io("create", &logs))?;
        folder.write_json(MANIFEST, &manifest)?;
        Ok((folder, manifest))
    }

    /// Opens a study's folder.
    ///
    /// # Errors
    /// [`TrainError::Input`] if it is not the folder of a study, or its manifest is damaged.
    pub fn open(root: &Path) -> Result<(Self, Manifest), TrainError> {
        let folder = Self { root: root.to_owned() };
        let manifest = folder.manifest()?;
        Ok((folder, manifest))
    }

    fn manifest(&self) -> Result<Manifest, TrainError> {
        let path = self.path(MANIFEST);
        let bytes = read_regular_file(&path, MAX_BYTES).map_err(|error| {
            let (root, path) = (self.root.display(), path.display());
            TrainError::Input(format!("{root} is not the folder of a study: {path}: {error}"))
        })?;
        let damaged = |problem: String| {
            TrainError::Input(format!(
                "{} is damaged: {problem}. Remove it and begin the study again: runs that are finished are kept",
                path.display()
            ))
        };
        let manifest: Manifest = serde_json::from_slice(&bytes).map_err(|error| damaged(error.to_string()))?;
        if manifest.is_sound() { Ok(manifest) } else { Err(damaged("its runs are not those of its study".into())) }
    }

    fn check_empty(&self) -> Result<(), TrainError> {
        let names = match fs::read_dir(&self.root) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(DataError::io("read", &self.root)(error).into()),
        };
        let ours = |name: &str| name == CONFIGURATIONS || name == LOGS;
        let foreign = names.flatten().map(|entry| entry.file_name()).find(|name| !name.to_str().is_some_and(ours));
        match foreign {
            // The folder of an earlier study without its manifest: the configurations of its runs are compared later.
            Some(_) if self.path(CONFIGURATIONS).is_dir() => Ok(()),
            Some(name) => Err(TrainError::Input(format!(
                "{} holds files but no study, among them `{}`; name another folder",
                self.root.display(),
                name.to_string_lossy()
            ))),
            None => Ok(()),
        }
    }

    /// Runs with the same name must have the same configuration.
    fn check_same(&self, found: &Manifest, wanted: &Manifest) -> Result<(), TrainError> {
        let root = self.root.display();
        for run in &wanted.runs {
            let scene = &wanted.scenes[run.scene];
            let known = found.runs.iter().find(|known| known.name == run.name);
            let other_scene = found.scenes.iter().any(|known| known.name == scene.name && known.path != scene.path);
            let differs =
                |known: &ManifestRun| known.configuration != run.configuration || known.training != run.training;
            if known.is_some_and(differs) || other_scene {
                return Err(TrainError::Input(format!(
                    "{root} holds run {} of another configuration or scene; name another folder with --out, or remove it",
                    run.name
                )));
            }
        }
        Ok(())
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    fn configuration(&self, run: &str) -> PathBuf {
        self.path(CONFIGURATIONS).join(format!("{run}.toml"))
    }

    /// The configuration that was planned for a run.
    ///
    /// # Errors
    /// If it cannot be read, or is not the one that the study was planned with.
    pub fn config_of(&self, run: &ManifestRun) -> Result<Config, TrainError> {
        let path = self.configuration(&run.name);
        let text = read_regular_text(&path, MAX_CONFIG_BYTES).map_err(DataError::io("read", &path))?;
        let config = Config::from_toml(&text, &path.display().to_string())?;
        if config.digest_text() == run.configuration {
            return Ok(config);
        }
        Err(TrainError::Input(format!(
            "{} is not the configuration that {MANIFEST} has the digest of; give the command that began the study again",
            path.display()
        )))
    }

    /// The file for the message of a task that failed.
    pub fn failure(&self, task: usize) -> PathBuf {
        self.path(LOGS).join(format!("task-{task}.failed"))
    }

    /// Writes a value as indented JSON into a file of the folder, whole or not at all.
    ///
    /// # Errors
    /// [`TrainError::Data`] naming the file.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), TrainError> {
        let mut text = serde_json::to_string_pretty(value).expect("plain data has a JSON form");
        text.push('\n');
        self.write(name, text.as_bytes())
    }

    /// Writes a file of the folder, whole or not at all.
    ///
    /// # Errors
    /// [`TrainError::Data`] naming the file.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), TrainError> {
        let path = self.path(name);
        Ok(write_atomically(&path, |file| file.write_all(bytes))?)
    }
}
