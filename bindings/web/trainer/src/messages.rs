//! Messages to the page, one a line.

use std::io::Write;

use serde_json::Value;

/// Sends a message to the page. It is no error if nobody is listening any more.
pub(crate) fn say(message: &Value) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{message}").and_then(|()| out.flush());
}
