//! What a command prints on standard output.

use std::fmt::Display;
use std::io::{ErrorKind, Write};

use crate::error::TrainError;

/// Prints a line, or a table. A reader that went away, such as `head`, is no error: the work goes on without it.
pub(super) fn say(text: impl Display) -> Result<(), TrainError> {
    match writeln!(std::io::stdout().lock(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(TrainError::Input(format!(
            "cannot write to standard output: {error}; redirect it to where there is room"
        ))),
        _ => Ok(()),
    }
}

/// Prints a value as pretty JSON.
pub(super) fn say_json(value: &impl serde::Serialize) -> Result<(), TrainError> {
    say(serde_json::to_string_pretty(value).expect("plain data has a JSON form"))
}
