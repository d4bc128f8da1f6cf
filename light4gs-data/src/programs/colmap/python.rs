//! COLMAP's Python package `pycolmap`, through a script that is a part of this program.

use super::{AGAIN, Effort, FILM_AGAIN, Job, Mapper, Motion, counted, registered};
use crate::error::DataError;
use crate::programs::{Heard, Program, version_in};
use serde_json::{Value, json};
use std::path::Path;

/// The interpreter; that of an active virtual environment is the first in `PATH`.
const PYTHON: Program = Program {
    name: "python3",
    variable: "LIGHT4GS_PYTHON",
    version_arguments: &["-c", "import pycolmap; print('version', pycolmap.__version__)"],
    oldest: (4, 0),
    install: "install it with `pip install pycolmap`",
};

/// The script; its first argument is JSON.
const SCRIPT: &str = include_str!("pycolmap.py");

/// Time for a mapper that places cameras one by one, in seconds: as long as the images need, but not for ever.
const LEAST_SECONDS: usize = 150;
const SECONDS_AN_IMAGE: usize = 5;

/// The version of the package, if there is one that is new enough.
pub(super) fn version() -> Option<String> {
    let output = PYTHON.output(PYTHON.command().args(PYTHON.version_arguments)).ok().filter(|o| o.status.success())?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    version_in(&text).filter(|version| *version >= PYTHON.oldest)?;
    Some(text.trim().strip_prefix("version ")?.to_owned())
}

/// Runs a stage, and returns the words of its last result.
fn run(
    job: &Job,
    stage: &str,
    options: Value,
    attempt: &str,
    remedy: &str,
    heard: &mut dyn FnMut(&str),
) -> Result<Vec<String>, DataError> {
    let mut settings = json!({
        "stage": stage,
        "database": job.database,
        "images": job.images,
        "list": job.list,
        "rig": job.rig,
        "camera_model": job.camera_model(),
    });
    if let (Value::Object(settings), Value::Object(options)) = (&mut settings, options) {
        settings.extend(options);
    }
    let mut result = Vec::new();
    let mut line = |line: Option<&str>| {
        let Some(line) = line else { return Heard::Forget };
        heard(line);
        if let Some(words) = line.strip_prefix("light4gs ") {
            result = words.split_whitespace().map(str::to_owned).collect();
        }
        // The package's log begins lines with a letter for their importance: information is not worth to be quoted.
        let information = line.starts_with('I') && line.contains(".cc:");
        if information || line.starts_with("    @ ") { Heard::Forget } else { Heard::Quote }
    };
    let mut command = PYTHON.command();
    command.args(["-c", SCRIPT]).arg(settings.to_string());
    PYTHON.stream(&mut command, &mut line, attempt, remedy)?;
    Ok(result)
}

pub(super) fn features(job: &Job, effort: Effort, done: &mut dyn FnMut(usize)) -> Result<(), DataError> {
    let options = json!({
        "size": effort.size,
        "features": effort.features,
        "first_octave": if effort.doubled { -1 } else { 0 },
    });
    let mut heard = |line: &str| {
        if let Some((count, _)) = counted(line) {
            done(count);
        }
    };
    run(job, "features", options, "finding features", AGAIN, &mut heard).map(drop)
}

pub(super) fn matches(job: &Job, pairs: &Path) -> Result<Motion, DataError> {
    let words = run(job, "matches", json!({ "pairs": pairs }), "matching features", AGAIN, &mut |_| {})?;
    let number = |i: usize| words.get(i).and_then(|word| word.parse().ok()).unwrap_or(0);
    Ok(Motion { turned: number(1), moved: number(2) })
}

pub(super) fn poses(job: &Job, sparse: &Path, mapper: Mapper, done: &mut dyn FnMut(usize)) -> Result<(), DataError> {
    let options = json!({
        "sparse": sparse,
        "global": mapper == Mapper::Global,
        "seconds": LEAST_SECONDS.max(SECONDS_AN_IMAGE * job.names.len()),
    });
    let mut most = 0;
    let mut heard = |line: &str| {
        if let Some(count) = registered(line).filter(|count| *count > most) {
            most = count;
            done(count);
        }
    };
    run(job, "poses", options, "finding poses", FILM_AGAIN, &mut heard).map(drop)
}
