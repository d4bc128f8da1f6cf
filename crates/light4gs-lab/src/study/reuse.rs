//! Trainings of other studies that need not be repeated.

use std::path::{Path, PathBuf};

use light4gs_train::config::Config;
use light4gs_train::error::TrainError;
use light4gs_train::run::RunFolder;

use super::manifest::StudyFolder;
use super::results::is_finished;

/// A finished run of other studies whose training a run with this configuration can take over: begun by this version of
/// the program on the same dataset, by the same `training` if that is one of the program's own, without changes during training,
/// and with a configuration that differs at most in how the file is written.
///
/// # Errors
/// A folder that holds no study; a finished run that is damaged.
pub fn find_trained(
    studies: &[PathBuf],
    scene: &Path,
    config: &Config,
    training: Option<&str>,
) -> Result<Option<PathBuf>, TrainError> {
    for study in studies {
        let (folder, manifest) = StudyFolder::open(study)?;
        let alike = manifest.runs.iter().filter(|run| run.training.as_deref() == training);
        for path in alike.map(|run| folder.path(&run.name)).filter(|path| is_finished(path)) {
            let (_, record, found) = RunFolder::open(&path)?;
            let unchanged = record.configuration == found.digest_text();
            let same_program = record.version == env!("CARGO_PKG_VERSION");
            let same_scene = record.scene.as_deref() == Some(scene);
            if unchanged && same_program && same_scene && found.trains_like(config) {
                return Ok(Some(path));
            }
        }
    }
    Ok(None)
}
