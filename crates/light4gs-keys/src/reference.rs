//! The texts that are generated from the declarations: the list of all keys, and the tables of `docs/configuration.md`.

use serde::Serialize;

use crate::names::joined;
use crate::{Bounds, Entry, KeyTable};

/// A key of the configuration.
#[derive(Clone, Debug)]
pub struct Key {
    /// Its name with the tables around it, such as `train.prune.fraction`.
    pub path: String,
    /// The values that it may have.
    pub bounds: Bounds,
    /// Its documentation.
    pub meaning: String,
    /// The source of the key or of its default.
    pub source: &'static str,
}

/// Every key of a table and of those in it, in the order of their declarations.
pub fn list<T: KeyTable>() -> Vec<Key> {
    fn walk(entries: &[Entry], prefix: &str, into: &mut Vec<Key>) {
        for entry in entries {
            match *entry {
                Entry::Key { name, bounds, meaning, source, .. } => {
                    into.push(Key { path: format!("{prefix}{name}"), bounds, meaning: joined(meaning), source });
                }
                Entry::Table { name, entries, .. } => walk(entries, &format!("{prefix}{name}."), into),
                Entry::Inlined(entries) => walk(entries, prefix, into),
            }
        }
    }
    let mut keys = Vec::new();
    walk(T::ENTRIES, "", &mut keys);
    keys
}

/// A table under its full name, without the tables in it.
struct Section {
    /// Empty for keys that are in no table.
    path: String,
    about: String,
    /// Each with its default as TOML.
    keys: Vec<(&'static str, String, Entry)>,
}

/// Every table that has keys, with the defaults as TOML.
fn sections<T: KeyTable + Default + Serialize>() -> Vec<Section> {
    fn walk(path: &str, about: &[&str], entries: &[Entry], defaults: &toml::Table, into: &mut Vec<Section>) {
        let mut keys = Vec::new();
        let mut tables = Vec::new();
        let mut open = vec![entries.iter()];
        while let Some(entries) = open.last_mut() {
            match entries.next() {
                None => _ = open.pop(),
                Some(Entry::Inlined(inner)) => open.push(inner.iter()),
                Some(key @ Entry::Key { name, .. }) => keys.push((*name, toml_value(&defaults[*name]), *key)),
                Some(Entry::Table { name, about, entries }) => tables.push((*name, *about, *entries)),
            }
        }
        if !keys.is_empty() {
            into.push(Section { path: path.to_owned(), about: joined(about), keys });
        }
        for (name, about, entries) in tables {
            let inner = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
            // A table without keys is not written.
            if let Some(toml::Value::Table(defaults)) = defaults.get(name) {
                walk(&inner, about, entries, defaults, into);
            }
        }
    }
    let defaults = toml::Table::try_from(T::default()).expect("defaults hold only what TOML can");
    let mut sections = Vec::new();
    walk("", T::ABOUT, T::ENTRIES, &defaults, &mut sections);
    sections
}

/// A value as people write it.
fn toml_value(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(value) => {
            // A value that was a float32 is shown with the digits of a float32.
            let narrow = *value as f32;
            let exact = f64::from(narrow) == *value;
            match (*value == 0.0 || (1e-3..1e6).contains(&value.abs()), exact) {
                (true, true) => format!("{narrow:?}"),
                (true, false) => format!("{value:?}"),
                (false, true) => format!("{narrow:e}"),
                (false, false) => format!("{value:e}"),
            }
        }
        toml::Value::Array(values) => {
            format!("[{}]", values.iter().map(toml_value).collect::<Vec<_>>().join(", "))
        }
        toml::Value::Table(values) => {
            let pair = |(name, value): (&String, &toml::Value)| format!("{name} = {}", toml_value(value));
            format!("{{ {} }}", values.iter().map(pair).collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}

/// Every key with its default, bounds, meaning and source, as Markdown tables: one for each table of the configuration.
pub fn markdown<T: KeyTable + Default + Serialize>() -> String {
    let mut text = String::new();
    for Section { path, about, keys } in sections::<T>() {
        if !path.is_empty() {
            text.push_str(&format!("\n### `[{path}]`\n\n{about}\n"));
        }
        text.push_str("\n| key | default | range | meaning | source |\n|---|---|---|---|---|\n");
        for (name, default, key) in keys {
            let Entry::Key { bounds, meaning, source, .. } = key else { continue };
            let key = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
            let meaning = [joined(meaning)].into_iter().chain(choices(&bounds)).collect::<Vec<_>>().join(" ");
            let bounds = match bounds {
                // The documentation of the named things lists their names.
                Bounds::NameOrNone { what, .. } => format!("empty, or the name of a {what}"),
                _ => bounds.to_string(),
            };
            text.push_str(&format!("| `{key}` | `{default}` | {bounds} | {meaning} | {source} |\n"));
        }
    }
    text
}

/// The meanings of the names among which a key chooses.
fn choices(bounds: &Bounds) -> Option<String> {
    match bounds {
        Bounds::Name(choices) => Some(choices.explained()),
        Bounds::List { element, .. } => choices(element),
        _ => None,
    }
}
