//! From a name to a configuration: reads a layer, follows `extends`, merges from the bottom up.

use std::fs;
use std::path::{Path, PathBuf};

use light4gs_data::read_regular_text;
use toml::{Table, Value};

use super::super::{Config, ConfigError, MAX_CONFIG_BYTES, Origin};
use super::schema::line_at;
use super::{Overrides, presets, schema};

/// The key by which a layer names the one below it.
const EXTENDS: &str = "extends";

/// Reads the layer at `top` and all below it, lays `above` and then the overrides on top, and validates.
pub(in crate::config) fn resolve(
    top: &Origin,
    above: &[Origin],
    override_texts: &[String],
) -> Result<Config, ConfigError> {
    let mut layers = Vec::new();
    collect(top, None, &mut Vec::new(), &mut layers)?;
    layers.reverse();
    for origin in above {
        layers.push((origin.clone(), on_top(origin, None)?));
    }
    layers.extend(Overrides::parse(override_texts)?.into_layers());
    build(layers)
}

/// The same for text, whose `extends` may name a preset or a path relative to the working folder.
pub(in crate::config) fn resolve_text(text: &str, origin: &str) -> Result<Config, ConfigError> {
    let origin = Origin::Text(origin.to_owned());
    let (layer, extends) = parse(text, &origin)?;
    let mut layers = vec![(origin.clone(), layer)];
    if let Some(below) = extends {
        collect_below(&below, &origin, &mut Vec::new(), &mut layers)?;
    }
    layers.reverse();
    build(layers)
}

/// Lays overrides over a configuration, and validates.
pub(in crate::config) fn lay_over(config: &Config, overrides: &Overrides) -> Result<Config, ConfigError> {
    let origin = Origin::Text("the configuration below the overrides".to_owned());
    let mut layers = match Table::try_from(config) {
        Ok(table) => vec![(origin, table)],
        Err(error) => return Err(ConfigError::Value { origin, message: one_line(&error.to_string()) }),
    };
    layers.extend(overrides.clone().into_layers());
    build(layers)
}

/// The names and paths that are joined by `+`, at least one. A folder such as those of a study's runs may have a `+` in its
/// name, so the longest path of a file that exists comes before shorter names. A path of which nothing exists stays
/// whole, so that the error names it as it was given.
pub(in crate::config) fn split(joined: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = joined;
    loop {
        let first = rest.find('+').unwrap_or(rest.len());
        let in_folder = rest[..first].contains(['/', '\\']);
        let mut ends = rest.match_indices('+').map(|(at, _)| at).chain([rest.len()]).rev();
        let file = ends.find(|&end| Path::new(&rest[..end]).is_file());
        let end = file.unwrap_or(if in_folder { rest.len() } else { first });
        parts.push(&rest[..end]);
        match rest.get(end + 1..) {
            Some(after) => rest = after,
            None => return parts,
        }
    }
}

/// What `name` means: a preset, or a path relative to `folder`.
pub(in crate::config) fn named(name: &str, folder: Option<&Path>) -> Origin {
    let path = folder.unwrap_or(Path::new("")).join(name);
    let plain = !name.ends_with(".toml") && !name.contains(['/', '\\']);
    let preset = plain && (presets::text(name).is_some() || !path.is_file());
    if preset { Origin::Preset(name.to_owned()) } else { Origin::File(path) }
}

/// Appends the layer at `origin` and those below it, the topmost first. `above` is the chain that led here.
fn collect(
    origin: &Origin,
    by: Option<&Origin>,
    above: &mut Vec<Origin>,
    into: &mut Vec<(Origin, Table)>,
) -> Result<(), ConfigError> {
    let (identity, text) = read(origin, by)?;
    if let Some(start) = above.iter().position(|seen| *seen == identity) {
        let mut chain = above.split_off(start);
        chain.push(identity);
        return Err(ConfigError::Cycle { chain });
    }
    above.push(identity);
    let (layer, extends) = parse(&text, origin)?;
    into.push((origin.clone(), layer));
    extends.map_or(Ok(()), |below| collect_below(&below, origin, above, into))
}

/// The same for what a layer extends: a name, or several joined by `+`.
fn collect_below(
    below: &str,
    by: &Origin,
    above: &mut Vec<Origin>,
    into: &mut Vec<(Origin, Table)>,
) -> Result<(), ConfigError> {
    let meant = |name: &str| match by {
        // The binary must not depend on the folder in which it runs.
        Origin::Preset(_) => Origin::Preset(name.to_owned()),
        Origin::File(path) => named(name, path.parent()),
        Origin::Text(_) => named(name, None),
    };
    let names = split(below);
    for name in names[1..].iter().rev() {
        let origin = meant(name);
        into.push((origin.clone(), on_top(&origin, Some(by))?));
    }
    collect(&meant(names[0]), Some(by), above, into)
}

/// A layer that may be laid on top of any other.
fn on_top(origin: &Origin, by: Option<&Origin>) -> Result<Table, ConfigError> {
    let (_, text) = read(origin, by)?;
    match parse(&text, origin)? {
        (layer, None) => Ok(layer),
        (_, Some(_)) => Err(ConfigError::LayerExtends { origin: origin.clone() }),
    }
}

/// The text of a layer, and its origin in a form that is the same for all paths of one file.
fn read(origin: &Origin, by: Option<&Origin>) -> Result<(Origin, String), ConfigError> {
    match origin {
        Origin::Preset(name) => {
            let text = presets::text(name).ok_or_else(|| ConfigError::UnknownPreset {
                name: name.clone(),
                by: by.cloned(),
                nearest: presets::nearest(name).to_owned(),
            })?;
            Ok((origin.clone(), text.to_owned()))
        }
        Origin::File(path) => {
            let failed = |source| ConfigError::Read { path: path.clone(), source };
            let identity: PathBuf = fs::canonicalize(path).map_err(failed)?;
            let text = read_regular_text(path, MAX_CONFIG_BYTES).map_err(failed)?;
            Ok((Origin::File(identity), text))
        }
        Origin::Text(text) => Ok((origin.clone(), text.clone())),
    }
}

/// Parses and checks one layer; returns it without `extends`, and what that says.
fn parse(text: &str, origin: &Origin) -> Result<(Table, Option<String>), ConfigError> {
    let mut layer: Table = toml::from_str(text).map_err(|error| {
        let line = error.span().map(|span| line_at(text, span.start));
        ConfigError::Syntax { origin: origin.clone(), line, message: one_line(error.message()) }
    })?;
    let extends = match layer.remove(EXTENDS) {
        None => None,
        Some(Value::String(name)) => Some(name),
        Some(other) => {
            return Err(ConfigError::WrongType {
                origin: origin.clone(),
                line: None,
                key: EXTENDS.to_owned(),
                expected: "a string, the name of a preset or a path".to_owned(),
                found: other.to_string(),
            });
        }
    };
    schema::check(&layer, text, origin)?;
    Ok((layer, extends))
}

/// Merges the layers over the defaults, the lowest first. The result must fit the structs after every layer, so that an
/// error names the layer that causes it.
fn build(layers: Vec<(Origin, Table)>) -> Result<Config, ConfigError> {
    let mut merged = schema::defaults();
    let mut config = Config::default();
    for (origin, layer) in layers {
        merge(&mut merged, layer);
        config = merged
            .clone()
            .try_into()
            .map_err(|error: toml::de::Error| ConfigError::Value { origin, message: one_line(&error.to_string()) })?;
    }
    config.validate()?;
    Ok(config)
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Lays `top` over `base`: tables are merged, everything else is replaced.
fn merge(base: &mut Table, top: Table) {
    for (key, value) in top {
        match (base.get_mut(&key), value) {
            (Some(Value::Table(base)), Value::Table(top)) => merge(base, top),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}
