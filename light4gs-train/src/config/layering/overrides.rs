//! Overrides of the command line: `train.fine_iterations=200`.

use toml::Table;

use super::super::{ConfigError, Origin};
use super::schema;

/// One override as a layer.
pub(super) fn parse(text: &str) -> Result<(Origin, Table), ConfigError> {
    let wrong = |message: String| ConfigError::Override { text: text.to_owned(), message };
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| wrong("expected key=value, such as train.fine_iterations=200".to_owned()))?;
    let (key, value) = (key.trim(), value.trim());
    if text.contains('\n') {
        return Err(wrong("expected one line".to_owned()));
    }
    // A shell strips quotes: a word that TOML does not know is a string.
    let quoted = || toml::Value::String(value.to_owned()).to_string();
    let layer = toml::from_str::<Table>(&format!("{key} = {value}"))
        .or_else(|error| {
            let word = !value.is_empty() && value.chars().all(|c| c.is_alphanumeric() || "-_./:".contains(c));
            if word { toml::from_str(&format!("{key} = {}", quoted())) } else { Err(error) }
        })
        .map_err(|error| wrong(format!("not valid TOML: {}", error.message())))?;
    if layer.contains_key("extends") {
        return Err(wrong("`extends` belongs in a file".to_owned()));
    }
    let origin = Origin::Text(format!("override `{text}`"));
    schema::check(&layer, text, &origin)?;
    Ok((origin, layer))
}
