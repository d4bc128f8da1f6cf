//! Tasks as a job array of Slurm.
//!
//! `sbatch` gets an array for the tasks of each stage that are not finished, each after the one before (`afterok`), and a
//! job after all of them (`afterany`) that puts together what they have made. Two minutes before the wall time is over, Slurm sends SIGUSR1 to the batch script, which forwards it. The
//! run writes a checkpoint and ends with exit code 75, and the script asks for its job to be queued again. A task that
//! was killed by a signal is queued again as well, a few times.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use light4gs_data::{DataError, read_regular_text, write_atomically};
use light4gs_train::error::TrainError;
use serde::Deserialize;

use super::super::output::say;
use super::TaskFolder;

const TASK_SCRIPT: &str = include_str!("task.sh");
const GATHER_SCRIPT: &str = include_str!("gather.sh");

/// The resources of jobs. Where one is not given, the cluster's default is used.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(in crate::cli) struct Settings {
    /// `--partition`
    partition: Option<String>,
    /// `--account`
    account: Option<String>,
    /// `--gpus` of a task
    gpus: Option<u32>,
    /// `--cpus-per-task`
    cpus: Option<u32>,
    /// `--mem`
    memory: Option<String>,
    /// `--time` of a task
    time: Option<String>,
    /// Seconds before the end of that time at which a run is asked to stop.
    signal_seconds: u32,
    /// How often a task that was killed is queued again.
    restarts: u32,
    /// More arguments for `sbatch`.
    arguments: Vec<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            partition: None,
            account: None,
            gpus: None,
            cpus: None,
            memory: None,
            time: None,
            signal_seconds: 120,
            restarts: 3,
            arguments: Vec::new(),
        }
    }
}

impl Settings {
    /// Reads the settings from a TOML file.
    ///
    /// # Errors
    /// [`TrainError::Input`] with the file and the key.
    pub(in crate::cli) fn load(path: &Path) -> Result<Self, TrainError> {
        let shown = path.display();
        let text = read_regular_text(path, 1 << 20)
            .map_err(|error| TrainError::Input(format!("{shown}: cannot read the settings of Slurm: {error}")))?;
        toml::from_str(&text).map_err(|error| {
            let message = error.to_string();
            TrainError::Input(format!("{shown}: {}. docs/studies.md has every key", message.trim()))
        })
    }

    fn common(&self) -> Vec<String> {
        let mut arguments = vec!["--parsable".to_owned()];
        arguments.extend(self.partition.iter().map(|partition| format!("--partition={partition}")));
        arguments.extend(self.account.iter().map(|account| format!("--account={account}")));
        arguments.extend(self.arguments.iter().cloned());
        arguments
    }

    fn of_tasks(&self) -> Vec<String> {
        let mut arguments = vec!["--requeue".to_owned(), "--open-mode=append".to_owned()];
        arguments.push(format!("--signal=B:USR1@{}", self.signal_seconds));
        arguments.extend(self.gpus.map(|gpus| format!("--gpus={gpus}")));
        arguments.extend(self.cpus.map(|cpus| format!("--cpus-per-task={cpus}")));
        arguments.extend(self.memory.iter().map(|memory| format!("--mem={memory}")));
        arguments.extend(self.time.iter().map(|time| format!("--time={time}")));
        arguments
    }
}

/// Submits the tasks of each stage, at most `jobs` at a time if that is more than 1. A stage begins when all tasks of the one
/// before have succeeded.
pub(in crate::cli) fn submit<T: TaskFolder>(
    folder: &T,
    stages: &[Vec<usize>],
    jobs: u32,
    settings: &Settings,
) -> Result<(), TrainError> {
    let program = std::env::current_exe().map_err(|error| TrainError::Input(format!("this program: {error}")))?;
    let root = std::path::absolute(folder.root()).map_err(|error| TrainError::Input(format!("--out: {error}")))?;
    let script = |name: &str, text: &str| -> Result<PathBuf, TrainError> {
        let path = root.join(".logs").join(name);
        write_atomically(&path, |file| file.write_all(text.as_bytes()))?;
        Ok(path)
    };
    let logs = root.join(".logs");
    std::fs::create_dir_all(&logs).map_err(DataError::io("create", &logs))?;
    let (task_script, gather_script) = (script("task.sh", TASK_SCRIPT)?, script("gather.sh", GATHER_SCRIPT)?);
    let mut array: Option<String> = None;
    for tasks in stages.iter().filter(|tasks| !tasks.is_empty()) {
        let mut command = Command::new("sbatch");
        command.args(settings.common()).args(settings.of_tasks());
        command.args(array.map(|job| format!("--dependency=afterok:{job}")));
        command.arg(format!("--array={}{}", ranges(tasks), if jobs > 1 { format!("%{jobs}") } else { String::new() }));
        command.arg(format!("--job-name={}", T::JOBS)).arg(format!("--output={}", logs.join("task-%a.log").display()));
        command.arg(&task_script).arg(&program).arg(settings.restarts.to_string()).arg(T::TASK).arg(&root);
        let job = sbatch(command)?;
        say(format_args!("{} tasks in job array {job}", tasks.len()))?;
        array = Some(job);
    }
    let mut command = Command::new("sbatch");
    command.args(settings.common());
    command.args(array.map(|job| format!("--dependency=afterany:{job}")));
    command
        .arg(format!("--job-name=light4gs-{}", T::GATHER))
        .arg(format!("--output={}", logs.join("gather.log").display()));
    command.arg(gather_script).arg(&program).arg(T::GATHER).arg(&root);
    let job = sbatch(command)?;
    say(format_args!(
        "job {job} puts the results together; `light4gs {} {}` does so at any time",
        T::GATHER,
        root.display()
    ))
}

/// Numbers in Slurm's notation: `0-3,5`.
fn ranges(numbers: &[usize]) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for &number in numbers {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => ranges.push((number, number)),
        }
    }
    let range =
        |(first, last): &(usize, usize)| if first == last { first.to_string() } else { format!("{first}-{last}") };
    ranges.iter().map(range).collect::<Vec<_>>().join(",")
}

/// Submits a job; returns its number, which `sbatch` prints.
fn sbatch(mut command: Command) -> Result<String, TrainError> {
    let output = command.output().map_err(|error| {
        TrainError::Input(format!(
            "cannot run sbatch: {error}; --launcher slurm is for the login node of a Slurm cluster"
        ))
    })?;
    let printed = String::from_utf8_lossy(&output.stdout);
    // With several clusters it prints JOB;CLUSTER.
    let job = printed.trim().split(';').next().unwrap_or_default().to_owned();
    if output.status.success() && !job.is_empty() && job.bytes().all(|byte| byte.is_ascii_digit()) {
        return Ok(job);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(TrainError::Input(format!("sbatch refused the job: {} {}", said.trim(), printed.trim())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_as_ranges() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(ranges(&[3]), "3");
    }

    #[test]
    fn wrong_settings_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cluster.toml");
        std::fs::write(&path, "partition = \"gpu\"\ngpu = 1\n").unwrap();
        let error = Settings::load(&path).unwrap_err().to_string();
        assert!(error.contains("cluster.toml") && error.contains("gpu"), "{error}");
        std::fs::write(&path, "partition = \"gpu\"\ngpus = 1\ntime = \"12:00:00\"\n").unwrap();
        let settings = Settings::load(&path).unwrap();
        assert!(settings.of_tasks().contains(&"--signal=B:USR1@120".to_owned()));
        assert!(Settings::load(&folder.path().join("no.toml")).is_err());
    }
}
