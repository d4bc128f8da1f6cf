//! Overrides of the command line: `train.fine_iterations=200`.

use toml::{Table, Value};

use super::super::{ConfigError, Origin};
use super::schema;

/// Keys that a user has set by hand: layers, each of one line, that are laid over a configuration last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides(Vec<(Origin, Table)>);

impl Overrides {
    /// Each text is a line of TOML, such as `train.fine_iterations=200` (a bare word is taken as a string). Of two that
    /// set the same key, the later one applies.
    ///
    /// # Errors
    /// [`ConfigError::Override`] for a text that is not `key=value`, [`ConfigError::UnknownKey`],
    /// [`ConfigError::WrongType`].
    pub fn parse(texts: &[String]) -> Result<Self, ConfigError> {
        texts.iter().map(|text| parse(text)).collect::<Result<_, _>>().map(Self)
    }

    /// Whether a key is set, by its full path.
    pub fn has(&self, key: &str) -> bool {
        self.0.iter().any(|(_, layer)| {
            let mut names = key.split('.');
            let first = names.next().and_then(|name| layer.get(name));
            names.try_fold(first, |value, name| Some(value?.get(name))).flatten().is_some()
        })
    }

    /// As layers, the lowest first.
    pub(super) fn into_layers(self) -> Vec<(Origin, Table)> {
        self.0
    }
}

/// One override as a layer.
fn parse(text: &str) -> Result<(Origin, Table), ConfigError> {
    let wrong = |message: String| ConfigError::Override { text: text.to_owned(), message };
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| wrong("expected key=value, such as train.fine_iterations=200".to_owned()))?;
    let (key, value) = (key.trim(), value.trim());
    if text.contains('\n') {
        return Err(wrong("expected one line".to_owned()));
    }
    // A shell strips quotes: a word that TOML does not know is a string.
    let quoted = || Value::String(value.to_owned()).to_string();
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
