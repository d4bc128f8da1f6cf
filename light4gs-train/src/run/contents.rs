//! The contents of a folder in which a run is to be made or opened. After a kill at any time it is one of these.

use std::fs;
use std::path::Path;

use light4gs_data::{DataError, is_temporary_name, read_regular_text, sweep_leftovers};

use super::list_checkpoints;
use super::lock::LOCK_FILE;
use crate::config::{Config, MAX_CONFIG_BYTES};
use crate::error::TrainError;

/// Names the run's scene. A folder with this file holds a run.
pub(super) const RECORD: &str = "run.json";

/// The digest of the dataset when the run began.
pub(super) const DATASET: &str = "dataset.json";

/// Files of a run; `--overwrite` removes them, in this order.
pub(super) const FILES: [&str; 11] = [
    RECORD,
    "config.toml",
    DATASET,
    "hidden.json",
    "metrics.jsonl",
    "scene.l4gs",
    "corrections.json",
    "coding.json",
    "bit_maps.json",
    "eval.json",
    "report.html",
];

/// Folders of a run; `--overwrite` removes them.
pub(super) const FOLDERS: [&str; 2] = ["checkpoints", "renders"];

/// Whether this is the path of a file that a run needs: its record or configuration, a log, a checkpoint. Commands may
/// write its `scene.l4gs`.
pub fn belongs_to_run(path: &Path) -> bool {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return false };
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(folder) = fs::canonicalize(folder) else { return false };
    let in_run = name != "scene.l4gs" && FILES.contains(&name) && folder.join(RECORD).exists();
    let is_checkpoint = || {
        let run = folder.parent().filter(|_| folder.file_name().is_some_and(|name| name == "checkpoints"));
        name.ends_with(".safetensors") && run.is_some_and(|run| run.join(RECORD).exists())
    };
    in_run || is_checkpoint()
}

/// The contents of a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Contents {
    /// The folder does not exist, or is empty.
    Nothing,
    /// A run that was stopped before it could train: nothing in it is needed.
    AbandonedStart,
    /// A run.
    Run,
    /// Parts of a run without its record: `--overwrite` was stopped while it removed the run, or the record was
    /// deleted.
    Remains,
    /// Something else; this is one of its entries.
    Foreign(String),
}

/// Examines a folder.
///
/// # Errors
/// If it cannot be read.
pub(super) fn of(root: &Path) -> Result<Contents, TrainError> {
    let failed = DataError::io("read", root);
    let mut names: Vec<String> = match fs::read_dir(root).and_then(Iterator::collect::<Result<Vec<_>, _>>) {
        Ok(entries) => entries.into_iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Contents::Nothing),
        Err(error) => return Err(failed(error).into()),
    };
    if names.iter().any(|name| name == RECORD) {
        return Ok(Contents::Run);
    }
    names.sort();
    let marked = names.iter().any(|name| name == LOCK_FILE);
    names.retain(|name| name != LOCK_FILE && !is_leftover(name));
    if names.is_empty() {
        return Ok(Contents::Nothing);
    }
    let foreign = names.iter().find(|name| !FILES.iter().chain(&FOLDERS).any(|ours| ours == name));
    if let Some(name) = foreign {
        return Ok(Contents::Foreign(name.clone()));
    }
    if !marked && !made_by_us(root, &names) {
        return Ok(Contents::Foreign(names.swap_remove(0)));
    }
    let worthless = names.iter().all(|name| match name.as_str() {
        "config.toml" => true,
        name if FOLDERS.contains(&name) => is_empty(&root.join(name)),
        _ => false,
    });
    Ok(if worthless { Contents::AbandonedStart } else { Contents::Remains })
}

/// Whether a folder without our lock file still looks like one of ours: it has checkpoints, or a configuration with
/// every key, as only this program writes it, or only empty folders.
fn made_by_us(root: &Path, names: &[String]) -> bool {
    let config = root.join("config.toml");
    let resolved = || {
        let text = read_regular_text(&config, MAX_CONFIG_BYTES).ok()?;
        let config = Config::from_toml(&text, "config.toml").ok()?;
        Some(config.to_toml() == text)
    };
    let only_folders = names.iter().all(|name| FOLDERS.contains(&name.as_str()));
    only_folders || !list_checkpoints(&root.join("checkpoints")).is_empty() || resolved() == Some(true)
}

/// Whether a folder is empty, except for temporary files that are swept.
fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder)
        .is_ok_and(|entries| entries.flatten().all(|entry| entry.file_name().to_str().is_some_and(is_leftover)))
}

/// Whether this is the name of an unfinished file: one of ours, or `.NAME.PID.part` of other programs.
fn is_leftover(name: &str) -> bool {
    let of_a_process = || {
        let (rest, process) = name.strip_prefix('.')?.strip_suffix(".part")?.rsplit_once('.')?;
        Some(!rest.is_empty() && !process.is_empty() && process.bytes().all(|byte| byte.is_ascii_digit()))
    };
    is_temporary_name(name) || of_a_process() == Some(true)
}

/// Removes temporary files of killed processes from a run folder. The caller holds its lock.
pub(super) fn sweep(root: &Path) {
    let renders = root.join("renders");
    let splits = fs::read_dir(&renders).into_iter().flatten().flatten().map(|entry| entry.path());
    let folders = FOLDERS.iter().map(|name| root.join(name)).chain([root.to_owned()]).chain(splits);
    for folder in folders {
        sweep_leftovers(&folder);
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            if name.to_str().is_some_and(|name| is_leftover(name) && !is_temporary_name(name)) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_has_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let state = || of(root).unwrap();
        assert_eq!(of(&root.join("missing")).unwrap(), Contents::Nothing);
        assert_eq!(state(), Contents::Nothing);
        fs::write(root.join(".light4gs-7-0.part"), "").unwrap();
        fs::write(root.join(".run.json.77.part"), "").unwrap();
        assert_eq!(state(), Contents::Nothing);
        fs::create_dir(root.join("checkpoints")).unwrap();
        assert_eq!(state(), Contents::AbandonedStart);
        // A configuration written by hand must not be replaced.
        fs::write(root.join("config.toml"), "extends = \"dnerf\"").unwrap();
        assert_eq!(state(), Contents::Foreign("checkpoints".into()));
        fs::write(root.join("config.toml"), Config::default().to_toml()).unwrap();
        assert_eq!(state(), Contents::AbandonedStart);
        fs::write(root.join("checkpoints/coarse_000001.safetensors"), "").unwrap();
        assert_eq!(state(), Contents::Remains);
        fs::write(root.join("notes.txt"), "").unwrap();
        assert_eq!(state(), Contents::Foreign("notes.txt".into()));
        assert!(!belongs_to_run(&root.join("config.toml")));
        fs::write(root.join(RECORD), "{}").unwrap();
        assert_eq!(state(), Contents::Run);
        for (path, belongs) in [
            (RECORD, true),
            ("checkpoints/../config.toml", true),
            ("checkpoints/fine_000001.safetensors", true),
            ("scene.l4gs", false),
            ("mine.l4gs", false),
            ("missing/run.json", false),
        ] {
            assert_eq!(belongs_to_run(&root.join(path)), belongs, "{path}");
        }
        sweep(root);
        assert!(!root.join(".light4gs-7-0.part").exists() && !root.join(".run.json.77.part").exists());
    }
}
