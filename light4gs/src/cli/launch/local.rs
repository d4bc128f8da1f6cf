//! Tasks as processes on this machine.

use std::fs::File;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

use light4gs_data::DataError;
use light4gs_train::error::TrainError;

use super::super::output::tell;
use super::super::signals::stop_flag;
use super::TaskFolder;

/// Time between two checks of the processes.
const PAUSE: Duration = Duration::from_millis(50);

/// A task that is running.
struct Running {
    task: usize,
    process: Child,
}

/// Runs tasks, `jobs` at a time. A task that fails does not stop the others.
///
/// # Errors
/// [`TrainError::Stopped`] if requested; a process that cannot be started.
pub(in crate::cli) fn run_all<T: TaskFolder>(
    folder: &T,
    tasks: Vec<usize>,
    jobs: usize,
    quiet: bool,
) -> Result<(), TrainError> {
    let stop = stop_flag();
    let mut waiting = tasks.into_iter();
    let mut running: Vec<Running> = Vec::new();
    let mut stopping = false;
    loop {
        if !stopping && stop.load(Ordering::Relaxed) {
            stopping = true;
            running.iter().for_each(|task| ask_to_stop(&task.process));
        }
        while !stopping && running.len() < jobs {
            let Some(task) = waiting.next() else { break };
            match start(folder, task, jobs, quiet) {
                Ok(process) => running.push(Running { task, process }),
                Err(error) => {
                    running.iter().for_each(|task| ask_to_stop(&task.process));
                    running.iter_mut().for_each(|task| drop(task.process.wait()));
                    return Err(error);
                }
            }
        }
        if running.is_empty() {
            break;
        }
        std::thread::sleep(PAUSE);
        let mut still = Vec::new();
        for mut task in running {
            match task.process.try_wait() {
                Ok(None) => still.push(task),
                Ok(Some(status)) => report(folder, task.task, status, jobs),
                Err(error) => tell(format_args!("task {}: cannot be waited for: {error}", task.task)),
            }
        }
        running = still;
    }
    match stopping {
        true => Err(TrainError::Stopped("stopped on request; the same command goes on from here".into())),
        false => Ok(()),
    }
}

fn start<T: TaskFolder>(folder: &T, task: usize, jobs: usize, quiet: bool) -> Result<Child, TrainError> {
    let failed = |error| TrainError::Input(format!("cannot start task {task}: {error}"));
    let program = std::env::current_exe().map_err(failed)?;
    let mut command = Command::new(program);
    command.arg(T::TASK).arg(folder.root()).arg(task.to_string()).stdin(Stdio::null());
    // Standard output is for the tables.
    command.stdout(Stdio::null());
    if jobs > 1 {
        let path = folder.log(task);
        command.stderr(File::create(&path).map_err(DataError::io("create", &path))?);
        const THREADS: &str = "RAYON_NUM_THREADS";
        if std::env::var_os(THREADS).is_none() {
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            command.env(THREADS, (cores / jobs).max(1).to_string());
        }
    }
    if quiet || jobs > 1 {
        command.arg("--quiet");
    }
    command.spawn().map_err(failed)
}

/// Forwards the request to stop. A process that has ended in the meantime needs none.
fn ask_to_stop(process: &Child) {
    let sent = Command::new("kill").args(["-USR1", &process.id().to_string()]).stderr(Stdio::null()).status();
    if let Err(error) = sent {
        tell(format_args!("warning: process {} cannot be asked to stop: {error}", process.id()));
    }
}

/// Reports a task that has failed, and writes a message for the summary if the task could not.
fn report(folder: &impl TaskFolder, task: usize, status: ExitStatus, jobs: usize) {
    if status.success() || status.code() == Some(i32::from(TrainError::Stopped(String::new()).exit_code())) {
        return;
    }
    let failure = folder.failure(task);
    // A task that was killed, or that panicked, has written no message.
    if !failure.exists() {
        let log = if jobs > 1 { format!("; see {}", folder.log(task).display()) } else { String::new() };
        let _ = std::fs::write(&failure, format!("{status}{log}\n"));
    }
    let said = std::fs::read_to_string(&failure).unwrap_or_else(|_| status.to_string());
    if jobs > 1 || status.code().is_none() {
        tell(format_args!("task {task} failed: {}", said.trim()));
    }
}
