//! Known keys and their types, taken from the default configuration, which writes every key.

use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::super::{Config, ConfigError, KEYS, Origin};

/// The default configuration as a table: every key that exists, with a value of its type.
pub(in crate::config) fn defaults() -> Table {
    Table::try_from(Config::default()).expect("the default configuration holds only what TOML can")
}

/// Checks that `layer` has only known keys, with values of the right types. `text` gives the line numbers.
pub(in crate::config) fn check(layer: &Table, text: &str, origin: &Origin) -> Result<(), ConfigError> {
    let known = defaults();
    check_table(&known, layer, &mut Vec::new(), &Context { known: &known, text, origin })
}

struct Context<'a> {
    known: &'a Table,
    text: &'a str,
    origin: &'a Origin,
}

impl Context<'_> {
    /// An override is one line long, so a line number would say nothing.
    fn line(&self, path: &[String]) -> Option<usize> {
        if matches!(self.origin, Origin::Text(_)) { None } else { line_of(self.text, path) }
    }
}

fn check_table(known: &Table, layer: &Table, path: &mut Vec<String>, context: &Context) -> Result<(), ConfigError> {
    for (key, value) in layer {
        path.push(key.clone());
        match (known.get(key), value) {
            (None, _) => {
                return Err(ConfigError::UnknownKey {
                    origin: context.origin.clone(),
                    line: context.line(path),
                    key: path.join("."),
                    nearest: nearest(context.known, path),
                });
            }
            (Some(Value::Table(_)), Value::Table(numbers)) if is_key(path) => {
                for (name, number) in numbers {
                    path.push(name.clone());
                    check_type(&Value::Float(0.0), number, path, context)?;
                    path.pop();
                }
            }
            (Some(Value::Table(known)), Value::Table(layer)) => check_table(known, layer, path, context)?,
            (Some(expected), value) => check_type(expected, value, path, context)?,
        }
        path.pop();
    }
    Ok(())
}

/// Whether a table is a key itself, with numbers by name: the configuration does not know all names.
fn is_key(path: &[String]) -> bool {
    let path = path.join(".");
    KEYS.iter().any(|key| key.path == path)
}

fn check_type(expected: &Value, value: &Value, path: &[String], context: &Context) -> Result<(), ConfigError> {
    if let Some((expected, found)) = mismatch(expected, value) {
        return Err(ConfigError::WrongType {
            origin: context.origin.clone(),
            line: context.line(path),
            key: path.join("."),
            expected,
            found,
        });
    }
    unreadable(value, path, context.origin)
}

/// Refuses what serde would refuse, but names the key where serde cannot, in a table that is flattened into another one.
fn unreadable(value: &Value, path: &[String], origin: &Origin) -> Result<(), ConfigError> {
    let path = path.join(".");
    let bounds = KEYS.iter().find(|key| key.path == path).map(|key| key.bounds);
    match bounds.and_then(|bounds| bounds.unreadable(value)) {
        Some(problem) => Err(ConfigError::Value { origin: origin.clone(), message: format!("{problem} in `{path}`") }),
        None => Ok(()),
    }
}

/// What was expected and what was found, if they differ.
fn mismatch(expected: &Value, found: &Value) -> Option<(String, String)> {
    let fits = match (expected, found) {
        // No key of ours holds a negative integer.
        (Value::Integer(_), Value::Integer(number)) => *number >= 0,
        (Value::Float(_), Value::Integer(_)) => true,
        (Value::Array(expected), Value::Array(found)) => {
            let element = expected.first()?;
            return found.iter().find_map(|value| mismatch(element, value)).map(|(expected, found)| {
                (format!("an array whose every element is {expected}"), format!("{found} among its elements"))
            });
        }
        _ => expected.same_type(found),
    };
    (!fits).then(|| (kind(expected).to_owned(), describe(found)))
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "a string",
        Value::Integer(_) => "a whole number of at least 0",
        Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "an array",
        Value::Table(_) => "a table",
    }
}

fn describe(value: &Value) -> String {
    match value {
        Value::Array(_) | Value::Table(_) => kind(value).to_owned(),
        _ => value.to_string(),
    }
}

/// The known key most like the one at `path`. The last name counts most, since that is where people mistype; a key
/// of the same name in another table comes next.
fn nearest(known: &Table, path: &[String]) -> String {
    let mut candidates = Vec::new();
    collect(known, &mut Vec::new(), &mut candidates);
    let (last, parents) = path.split_last().map(|(last, parents)| (last.as_str(), parents)).unwrap_or(("", &[]));
    let whole = path.join(".");
    candidates
        .into_iter()
        .min_by_key(|candidate| {
            let elsewhere = candidate.len() != path.len() || candidate[..candidate.len() - 1] != *parents;
            let name = candidate.last().map(String::as_str).unwrap_or("");
            let distance = strsim::damerau_levenshtein(name, last) + usize::from(elsewhere);
            (distance, strsim::damerau_levenshtein(&candidate.join("."), &whole))
        })
        .unwrap_or_default()
        .join(".")
}

fn collect(table: &Table, path: &mut Vec<String>, into: &mut Vec<Vec<String>>) {
    for (key, value) in table {
        path.push(key.clone());
        into.push(path.clone());
        if let Value::Table(table) = value {
            collect(table, path, into);
        }
        path.pop();
    }
}

/// The line, from 1, of a byte of the text.
pub(super) fn line_at(text: &str, start: usize) -> usize {
    text.bytes().take(start).filter(|byte| *byte == b'\n').count() + 1
}

/// The line, from 1, on which the key at `path` stands.
fn line_of(text: &str, path: &[String]) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut table = root.get_ref();
    for (depth, name) in path.iter().enumerate() {
        let (key, value) = table.iter().find(|(key, _)| key.get_ref().as_ref() == name.as_str())?;
        if depth + 1 == path.len() {
            return Some(line_at(text, key.span().start));
        }
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => return None,
        }
    }
    None
}
