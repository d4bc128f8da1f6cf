//! `metrics.jsonl`: measurements of a run while it trains, one JSON object for each line.
//!
//! Every line is written in one piece and passed to the system at once, so a run that is killed loses at most the line
//! that it was writing. A run that resumes from a checkpoint first removes the lines after it.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use light4gs_data::{DataError, read_regular_file, write_atomically};
use serde::{Deserialize, Serialize};

use super::Observer;
use crate::error::TrainError;
use crate::stage::Stage;

/// One line of `metrics.jsonl`. Values that were not measured are absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MetricsRecord {
    /// Stage of the run.
    pub stage: Stage,
    /// Iterations done in that stage.
    pub iteration: usize,
    /// Seconds of training so far, all sessions of the run together.
    pub seconds: f64,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// The whole loss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<f64>,
    /// PSNR of the training frames of this iteration, dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psnr: Option<f64>,
    /// PSNR over test views, dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test_psnr: Option<f64>,
    /// Speed since the last line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iterations_per_second: Option<f64>,
    /// Further values by name: parts of the loss, learning rates.
    #[serde(flatten)]
    pub extra: BTreeMap<String, f64>,
}

impl MetricsRecord {
    /// A record that has only the training position.
    pub fn new(stage: Stage, iteration: usize, seconds: f64, gaussians: usize) -> Self {
        Self {
            stage,
            iteration,
            seconds,
            gaussians,
            loss: None,
            psnr: None,
            test_psnr: None,
            iterations_per_second: None,
            extra: BTreeMap::new(),
        }
    }

    /// JSON has no infinity: a value that is not finite is left out.
    fn finite(&self) -> Self {
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        Self {
            seconds: if self.seconds.is_finite() { self.seconds } else { 0.0 },
            loss: finite(self.loss),
            psnr: finite(self.psnr),
            test_psnr: finite(self.test_psnr),
            iterations_per_second: finite(self.iterations_per_second),
            extra: self.extra.iter().filter(|(_, value)| value.is_finite()).map(|(k, v)| (k.clone(), *v)).collect(),
            ..self.clone()
        }
    }
}

/// Appends to `metrics.jsonl`.
#[derive(Debug)]
pub struct MetricsLog {
    path: PathBuf,
    file: File,
}

impl Observer for MetricsLog {
    fn on_log(&mut self, record: &MetricsRecord) -> Result<(), TrainError> {
        Ok(self.append(record)?)
    }
}

impl MetricsLog {
    /// Opens the file for appending; it is made if it does not exist. A half-written last line is removed.
    ///
    /// # Errors
    /// [`DataError`] naming the file, and the line where one before the last is damaged.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        if path.exists() {
            keep_lines(path, |_| true)?;
        }
        Ok(Self { path: path.to_path_buf(), file: open_to_append(path)? })
    }

    /// Appends a record and passes it to the system.
    ///
    /// # Errors
    /// [`DataError::Io`] naming the file.
    pub fn append(&mut self, record: &MetricsRecord) -> Result<(), DataError> {
        let mut line =
            serde_json::to_string(&record.finite()).map_err(|error| failed("write", &self.path)(error.into()))?;
        line.push('\n');
        self.file.write_all(line.as_bytes()).and_then(|()| self.file.flush()).map_err(failed("write", &self.path))
    }

    /// Removes every record after this training position, for a run that resumes there.
    ///
    /// The file is replaced in one step: after a crash it is either the old one or the new one.
    ///
    /// # Errors
    /// As [`MetricsLog::open`].
    pub fn truncate_after(&mut self, stage: Stage, iteration: usize) -> Result<(), DataError> {
        keep_lines(&self.path, |record| (record.stage, record.iteration) <= (stage, iteration))?;
        self.file = open_to_append(&self.path)?;
        Ok(())
    }
}

/// Reads all records. An unfinished last line is ignored.
///
/// # Errors
/// [`DataError`] naming the file, and the line where another one is damaged.
pub fn read_metrics(path: &Path) -> Result<Vec<MetricsRecord>, DataError> {
    Ok(read_lines(path)?.lines.into_iter().map(|(_, record)| record).collect())
}

/// The records of a file, and their text.
struct Lines {
    lines: Vec<(String, MetricsRecord)>,
    /// Whether the file has anything besides these lines, each with its line feed.
    has_rest: bool,
}

fn read_lines(path: &Path) -> Result<Lines, DataError> {
    // The unfinished line may end in the middle of a character.
    let bytes = read_regular_file(path, u64::MAX).map_err(failed("read", path))?;
    let text = String::from_utf8_lossy(&bytes);
    let finished = text.is_empty() || text.ends_with('\n');
    let count = text.lines().count();
    let mut lines = Vec::with_capacity(count);
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        match serde_json::from_str(line) {
            Ok(record) => lines.push((line.to_owned(), record)),
            Err(_) if index + 1 == count && !finished => break,
            Err(error) => {
                return Err(DataError::Field {
                    path: path.to_path_buf(),
                    field: format!("line {}", index + 1),
                    problem: format!("not a record of metrics: {error}"),
                    remedy: "delete the line, or the file if its curves are not needed".to_owned(),
                });
            }
        }
    }
    let length: usize = lines.iter().map(|(line, _)| line.len() + 1).sum();
    Ok(Lines { has_rest: length != bytes.len(), lines })
}

/// Replaces the file by the lines whose records `keep` accepts, if that changes it.
fn keep_lines(path: &Path, keep: impl Fn(&MetricsRecord) -> bool) -> Result<(), DataError> {
    let Lines { lines, has_rest } = read_lines(path)?;
    let kept: Vec<&String> = lines.iter().filter(|(_, record)| keep(record)).map(|(line, _)| line).collect();
    if kept.len() == lines.len() && !has_rest {
        return Ok(());
    }
    write_atomically(path, |out| kept.iter().try_for_each(|line| writeln!(out, "{line}")))
}

fn open_to_append(path: &Path) -> Result<File, DataError> {
    OpenOptions::new().create(true).append(true).open(path).map_err(failed("open", path))
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> DataError {
    let path = path.to_path_buf();
    move |source| DataError::Io { action, path, source }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn record(stage: Stage, iteration: usize) -> MetricsRecord {
        let mut record = MetricsRecord::new(stage, iteration, iteration as f64 / 10.0, 100 + iteration);
        record.loss = Some(0.1 / (iteration + 1) as f64);
        record.extra.insert("l1".to_owned(), 0.25);
        record
    }

    fn write(path: &Path) {
        let mut log = MetricsLog::open(path).expect("a log");
        for (stage, iteration) in [(Stage::Coarse, 10), (Stage::Coarse, 20), (Stage::Fine, 10), (Stage::Fine, 20)] {
            log.append(&record(stage, iteration)).expect("a line");
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("metrics.jsonl");
        write(&path);
        let records = read_metrics(&path).expect("records");
        assert_eq!(records.len(), 4);
        assert_eq!(records[2], record(Stage::Fine, 10));
    }

    #[test]
    fn resuming_drops_what_came_later_and_goes_on() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("metrics.jsonl");
        write(&path);
        let mut log = MetricsLog::open(&path).expect("a log");
        log.truncate_after(Stage::Fine, 10).expect("truncated");
        log.append(&record(Stage::Fine, 11)).expect("a line");
        let places: Vec<_> = read_metrics(&path).expect("records").iter().map(|r| (r.stage, r.iteration)).collect();
        assert_eq!(places, [(Stage::Coarse, 10), (Stage::Coarse, 20), (Stage::Fine, 10), (Stage::Fine, 11)]);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn a_line_cut_off_anywhere_is_dropped() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("metrics.jsonl");
        write(&path);
        let whole = fs::read(&path).expect("bytes");
        let third_end = whole.iter().enumerate().filter(|(_, byte)| **byte == b'\n').nth(2).expect("lines").0 + 1;
        for length in third_end..whole.len() {
            fs::write(&path, &whole[..length]).expect("cut");
            let expected = if length + 1 == whole.len() { 4 } else { 3 };
            assert_eq!(read_metrics(&path).expect("records").len(), expected, "cut at {length}");
            let mut log = MetricsLog::open(&path).expect("a log");
            log.append(&record(Stage::Fine, 30)).expect("a line");
            assert_eq!(read_metrics(&path).expect("records").len(), expected + 1, "cut at {length}");
        }
    }

    #[test]
    fn damage_in_the_middle_names_the_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("metrics.jsonl");
        write(&path);
        let text = fs::read_to_string(&path).expect("text").replacen("\"stage\":\"fine\"", "\"stage\":\"final\"", 1);
        fs::write(&path, text).expect("damage");
        let message = read_metrics(&path).expect_err("damage").to_string();
        assert!(message.contains("metrics.jsonl") && message.contains("line 3"), "{message}");
    }

    #[test]
    fn values_that_are_not_finite_are_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("metrics.jsonl");
        let mut bad = record(Stage::Coarse, 1);
        bad.psnr = Some(f64::INFINITY);
        bad.extra.insert("rate".to_owned(), f64::NAN);
        MetricsLog::open(&path).expect("a log").append(&bad).expect("a line");
        assert_eq!(read_metrics(&path).expect("records"), [record(Stage::Coarse, 1)]);
    }
}
