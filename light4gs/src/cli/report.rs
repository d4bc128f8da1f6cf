//! `report`: what an issue needs to say of program, machine and last error.

use std::env;
use std::fs;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use light4gs_data::write_atomically;
use light4gs_train::config::DeviceName;
use light4gs_train::device::{self, built_in, describe};
use light4gs_train::error::TrainError;
use light4gs_train::provenance::{COMMIT, machine};

use super::output::say;

/// An argument that is shorter than this is not looked for in a message: it would be found in the middle of words.
const SHORTEST: usize = 3;

#[derive(Debug, Args)]
pub(super) struct Report {}

impl Report {
    #[allow(clippy::unused_self)] // As every command.
    pub(super) fn run(self) -> Result<(), TrainError> {
        say(format_args!("light4gs {}, commit {COMMIT}", env!("CARGO_PKG_VERSION")))?;
        say(format_args!("system: {} on {}; {}", env::consts::OS, env::consts::ARCH, machine()))?;
        if let Some(kilobytes) = memory() {
            say(format_args!("memory: {:.1} GiB", kilobytes as f64 / f64::from(1 << 20)))?;
        }
        let back_ends: Vec<&str> = built_in().into_iter().filter(|name| *name != "auto").collect();
        say(format_args!("back ends: {}", back_ends.join(", ")))?;
        let chosen = device::chosen(DeviceName::Auto);
        let opened = device::open(chosen).map_or_else(|error| error.to_string(), |device| describe(chosen, &device));
        say(format_args!("--device auto: {opened}"))?;
        for (number, adapter) in device::adapters().into_iter().enumerate() {
            say(format_args!("wgpu:{number}: {adapter}"))?;
        }
        let error = last_error_file().and_then(|file| fs::read_to_string(file).ok());
        say(format_args!("last error: {}", error.as_deref().map_or("none", str::trim)))
    }
}

/// Memory of this machine in kilobytes, where Linux tells.
fn memory() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?.split_whitespace().next()?.parse().ok()
}

/// Keeps an error for the next report, without names of the user. What cannot be written is left.
pub(super) fn remember(error: &TrainError) {
    let arguments: Vec<String> =
        env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned()).collect();
    let command = arguments.first().filter(|name| !name.starts_with('-')).cloned().unwrap_or_default();
    let text = format!(
        "{command}, exit code {}: {}",
        error.exit_code(),
        without_names(&error.to_string(), &arguments[1.min(arguments.len())..])
    );
    let Some(file) = last_error_file() else { return };
    let _ = file.parent().map(fs::create_dir_all);
    let _ = write_atomically(&file, |file| file.write_all(text.as_bytes()));
}

/// A message in which everything that may be a path, and every argument and part of a path among them, is a placeholder.
fn without_names(message: &str, arguments: &[String]) -> String {
    let words = message.split(' ').map(|word| if word.contains(['/', '\\']) { "PATH" } else { word });
    let mut text = words.collect::<Vec<_>>().join(" ");
    let parts = arguments.iter().flat_map(|argument| argument.split(['/', '\\', '=']));
    let mut names: Vec<&str> =
        parts.filter(|part| part.len() >= SHORTEST && !part.starts_with('-') && part.parse::<f64>().is_err()).collect();
    // The longest first: one may be a part of another.
    names.sort_by_key(|name| std::cmp::Reverse(name.len()));
    for name in names {
        text = text.replace(name, "ARGUMENT");
    }
    text
}

/// Where the last error is kept: the folder in which systems keep the state of programs.
fn last_error_file() -> Option<PathBuf> {
    let home = || env::home_dir().map(|home| home.join(".local/state"));
    let state = env::var_os("XDG_STATE_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let local = env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|_| cfg!(windows));
    Some(state.or(local).or_else(home)?.join("light4gs/last-error.txt"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_lose_the_names_of_their_user() {
        let arguments = ["data/anna", "--out", "runs/anna-2", "--set", "seed=7"].map(str::to_owned);
        let message = "anna holds a run already; /home/anna/x.png cannot be read, seed is 7 of anna-2";
        let expected = "ARGUMENT holds a run already; PATH cannot be read, ARGUMENT is 7 of ARGUMENT";
        assert_eq!(without_names(message, &arguments), expected);
    }
}
