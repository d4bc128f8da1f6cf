//! The output of commands.

pub(super) mod progress;

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{ErrorKind, Write};

use light4gs_train::error::TrainError;

/// Prints a line, or a table. A reader that has gone away, such as `head`, is no error: the work continues without it.
pub(super) fn say(text: impl Display) -> Result<(), TrainError> {
    match writeln!(std::io::stdout().lock(), "{}", printable(&text.to_string())) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(TrainError::Input(format!(
            "cannot write to standard output: {error}; redirect it to where there is room"
        ))),
        _ => Ok(()),
    }
}

/// Prints a line, or a table, on standard error. An error there is ignored, since it cannot be reported.
pub(super) fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable(&text.to_string()));
}

/// Prints a value as pretty JSON.
pub(super) fn say_json(value: &impl serde::Serialize) -> Result<(), TrainError> {
    say(serde_json::to_string_pretty(value).expect("plain data has a JSON form"))
}

/// Text for a terminal. Names come from files of strangers and may contain characters that control a terminal: control
/// characters, and marks that change the direction of writing, are written as JSON escapes.
fn printable(text: &str) -> Cow<'_, str> {
    let obeyed = |c: char| {
        let turns =
            matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{61c}');
        turns || (c.is_control() && c != '\n' && c != '\t')
    };
    if !text.contains(obeyed) {
        return Cow::Borrowed(text);
    }
    let escape = |c: char| if obeyed(c) { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    Cow::Owned(text.chars().map(escape).collect())
}

#[cfg(test)]
mod tests {
    use super::printable;

    #[test]
    fn a_terminal_gets_nothing_that_it_obeys() {
        assert_eq!(printable("a\tb\n█ ×"), "a\tb\n█ ×");
        assert_eq!(printable("\u{1b}]0;x\u{7}\r\u{9b}2J\u{202e}"), "\\u001b]0;x\\u0007\\u000d\\u009b2J\\u202e");
    }
}
