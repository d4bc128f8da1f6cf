//! What a command prints.

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

/// Prints a line, or a table, on standard error. Where even that takes nothing there is nobody left to tell.
pub(super) fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// Prints a value as pretty JSON.
pub(super) fn say_json(value: &impl serde::Serialize) -> Result<(), TrainError> {
    say(serde_json::to_string_pretty(value).expect("plain data has a JSON form"))
}
