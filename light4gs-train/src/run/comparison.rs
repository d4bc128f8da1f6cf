//! Differences between runs: program, machine and data, configuration, results.

use std::path::{Path, PathBuf};

use light4gs_data::read_regular_file;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::RunFolder;
use crate::error::TrainError;

/// Lists of an evaluation with an entry for each view or plane: too long to compare.
const LONG_LISTS: [&str; 2] = ["views", "planes"];

/// The digest of a run's dataset when it began, in the run's folder.
const DATASET: &str = "dataset.json";
/// Such files are far shorter.
const MAX_DATASET_BYTES: u64 = 1 << 28;

/// A value that is not the same in all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Full path, such as `train.batch_size` or `splits.test.psnr`.
    pub key: String,
    /// One for each run; `None` if a run does not have it.
    pub values: Vec<Option<String>>,
}

/// Differences between runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Folders of the runs.
    pub runs: Vec<PathBuf>,
    /// Differences of `run.json`: program, machine, data.
    pub provenance: Vec<Difference>,
    /// Differences of `config.toml`.
    pub configuration: Vec<Difference>,
    /// Differences of `eval.json`, which only measured runs have.
    pub results: Vec<Difference>,
}

impl Comparison {
    /// Compares the runs, of which there must be at least one.
    ///
    /// # Errors
    /// [`TrainError::Input`] for a folder that holds no run, or a damaged one.
    pub fn new(runs: &[PathBuf]) -> Result<Self, TrainError> {
        let all = runs.iter().map(|run| leaves_of(run)).collect::<Result<Vec<_>, _>>()?;
        let part = |pick: fn(&RunLeaves) -> &Leaves| differences(&all.iter().map(pick).collect::<Vec<_>>());
        Ok(Self {
            runs: runs.to_vec(),
            provenance: part(|run| &run.provenance),
            configuration: part(|run| &run.configuration),
            results: part(|run| &run.results),
        })
    }
}

type Leaves = Vec<(String, String)>;

struct RunLeaves {
    provenance: Leaves,
    configuration: Leaves,
    results: Leaves,
}

fn leaves_of(run: &Path) -> Result<RunLeaves, TrainError> {
    let (folder, record, config) = RunFolder::open(run)?;
    let to_json = |value: Result<Value, serde_json::Error>| value.expect("plain data has a JSON form");
    let evaluation: Option<Value> = folder.read_json("eval.json")?;
    let mut provenance = leaves(&to_json(serde_json::to_value(&record)));
    // The digest of a dataset is long; only whether it differs is shown.
    if let Ok(dataset) = read_regular_file(&folder.path(DATASET), MAX_DATASET_BYTES) {
        let digest: String = Sha256::digest(&dataset).iter().map(|byte| format!("{byte:02x}")).collect();
        provenance.push(("data".to_owned(), digest));
    }
    Ok(RunLeaves {
        provenance,
        configuration: leaves(&to_json(serde_json::to_value(&config))),
        results: evaluation.map(|value| leaves(&value)).unwrap_or_default(),
    })
}

/// Every number, text and switch with its path. Entries of lists are identified by their `name` or `split`.
fn leaves(value: &Value) -> Leaves {
    let mut found = Vec::new();
    collect(value, String::new(), &mut found);
    found
}

fn collect(value: &Value, path: String, found: &mut Leaves) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        Value::Object(fields) => {
            for (name, value) in fields.iter().filter(|(name, _)| !LONG_LISTS.contains(&name.as_str())) {
                collect(value, below(name), found);
            }
        }
        Value::Array(entries) if entries.iter().any(Value::is_object) => {
            for (index, entry) in entries.iter().enumerate() {
                let named = ["name", "split"].iter().find_map(|key| entry.get(key)?.as_str());
                collect(entry, below(named.unwrap_or(&index.to_string())), found);
            }
        }
        Value::String(text) => found.push((path, text.clone())),
        other => found.push((path, other.to_string())),
    }
}

fn differences(runs: &[&Leaves]) -> Vec<Difference> {
    let mut keys: Vec<&String> = Vec::new();
    for (key, _) in runs.iter().copied().flatten() {
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let value = |run: &Leaves, key: &String| run.iter().find(|(known, _)| known == key).map(|(_, value)| value.clone());
    let of_key =
        |key: &String| Difference { key: key.clone(), values: runs.iter().map(|run| value(run, key)).collect() };
    let differs = |difference: &Difference| difference.values.iter().any(|value| *value != difference.values[0]);
    keys.into_iter().map(of_key).filter(differs).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn only_what_differs_is_said() {
        let one =
            leaves(&json!({"bytes": 5, "splits": [{"split": "test", "psnr": 20.5, "views": [1, 2]}], "size": [2, 3]}));
        let other =
            leaves(&json!({"bytes": 6, "splits": [{"split": "test", "psnr": 20.5}], "size": [2, 3], "more": true}));
        let found = differences(&[&one, &other]);
        let difference = |key: &str, values: [Option<&str>; 2]| Difference {
            key: key.into(),
            values: values.map(|value| value.map(str::to_owned)).into(),
        };
        assert_eq!(found, [difference("bytes", [Some("5"), Some("6")]), difference("more", [None, Some("true")])]);
        assert!(differences(&[&one, &one]).is_empty());
        assert!(differences(&[&one]).is_empty() && differences(&[]).is_empty());
    }
}
