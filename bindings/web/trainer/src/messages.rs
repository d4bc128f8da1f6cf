//! Messages to the page, one a line.

use std::io::Write;

use serde_json::Value;

/// Says something to the page. Nobody may be listening any more: that is no error.
pub(crate) fn say(message: &Value) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{message}").and_then(|()| out.flush());
}
