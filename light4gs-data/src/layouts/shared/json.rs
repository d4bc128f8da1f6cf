//! Reading JSON files. Every bad field is named in the error.

use crate::error::DataError;
use crate::regular_file::read_regular_text;
use serde_json::Value;
use std::path::Path;

/// Largest size in bytes. A file of cameras has kilobytes, so a larger file is something else.
const MAX_BYTES: u64 = 256 << 20;

/// Reads a JSON file. The words `NaN`, `Infinity` and `-Infinity`, which Python writes though JSON has no such numbers,
/// are returned as strings, so that the check of the field can name it.
pub(in crate::layouts) fn read(path: &Path) -> Result<Value, DataError> {
    let text = read_regular_text(path, MAX_BYTES).map_err(DataError::io("read", path))?;
    serde_json::from_str(&text).or_else(|source| {
        serde_json::from_str(&quote_non_finite(&text)).map_err(|_| DataError::Json { path: path.to_path_buf(), source })
    })
}

/// Puts quotes around `NaN`, `Infinity`, `-Infinity` outside of strings.
fn quote_non_finite(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 64);
    let mut rest = text;
    let mut in_string = false;
    while let Some(c) = rest.chars().next() {
        let word = ["NaN", "Infinity", "-Infinity"].into_iter().find(|word| !in_string && rest.starts_with(word));
        let taken = if let Some(word) = word {
            out.push('"');
            out.push_str(word);
            out.push('"');
            word.len()
        } else if in_string && c == '\\' {
            let two = rest.char_indices().nth(2).map_or(rest.len(), |(i, _)| i);
            out.push_str(&rest[..two]);
            two
        } else {
            in_string ^= c == '"';
            out.push(c);
            c.len_utf8()
        };
        rest = &rest[taken..];
    }
    out
}

/// A short word for the type of a field's value, for messages.
pub(in crate::layouts) fn describe(value: Option<&Value>) -> String {
    match value {
        None => "missing".into(),
        Some(Value::Array(items)) => format!("a list of {}", items.len()),
        Some(Value::Object(_)) => "an object".into(),
        Some(other) => super::files::shorten(&other.to_string()),
    }
}

/// A finite number, or an error that names the field and what was expected.
pub(in crate::layouts) fn finite(
    path: &Path,
    field: &str,
    value: Option<&Value>,
    expected: &str,
    remedy: &str,
) -> Result<f64, DataError> {
    value.and_then(Value::as_f64).filter(|v| v.is_finite()).ok_or_else(|| {
        let found = describe(value);
        DataError::field(path, field, format!("{found}, expected {expected}"), remedy)
    })
}

/// As [`finite`], for a field that may be absent: then it is `default`.
pub(in crate::layouts) fn finite_or(
    path: &Path,
    field: &str,
    value: Option<&Value>,
    default: f64,
    remedy: &str,
) -> Result<f64, DataError> {
    value.map_or(Ok(default), |value| finite(path, field, Some(value), "a finite number", remedy))
}

/// A list of `N` finite numbers.
pub(in crate::layouts) fn numbers<const N: usize>(
    path: &Path,
    field: &str,
    value: Option<&Value>,
    remedy: &str,
) -> Result<[f64; N], DataError> {
    let list = value.and_then(Value::as_array).filter(|list| list.len() == N).ok_or_else(|| {
        DataError::field(path, field, format!("{}, expected a list of {N} numbers", describe(value)), remedy)
    })?;
    let mut out = [0.0; N];
    for (i, value) in list.iter().enumerate() {
        out[i] = finite(path, &format!("{field}[{i}]"), Some(value), "a finite number", remedy)?;
    }
    Ok(out)
}

/// Rows of `N` finite numbers: at least `M` of them; further rows are ignored.
pub(in crate::layouts) fn rows<const M: usize, const N: usize>(
    path: &Path,
    field: &str,
    value: Option<&Value>,
    remedy: &str,
) -> Result<[[f64; N]; M], DataError> {
    let list = value.and_then(Value::as_array).filter(|list| list.len() >= M).ok_or_else(|| {
        let found = describe(value);
        DataError::field(path, field, format!("{found}, expected {M} rows of {N} numbers"), remedy)
    })?;
    let mut out = [[0.0; N]; M];
    for (i, row) in out.iter_mut().enumerate() {
        *row = numbers(path, &format!("{field}[{i}]"), list.get(i), remedy)?;
    }
    Ok(out)
}

/// A list of words.
pub(in crate::layouts) fn words(
    path: &Path,
    field: &str,
    value: Option<&Value>,
    remedy: &str,
) -> Result<Vec<String>, DataError> {
    let expected = |what: String| DataError::field(path, field, format!("{what}, expected a list of names"), remedy);
    let list = value.and_then(Value::as_array).ok_or_else(|| expected(describe(value)))?;
    list.iter()
        .enumerate()
        .map(|(i, word)| {
            let found = || {
                DataError::field(
                    path,
                    format!("{field}[{i}]"),
                    format!("{}, expected a name", describe(Some(word))),
                    remedy,
                )
            };
            word.as_str().map(str::to_owned).ok_or_else(found)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn non_finite_words_are_quoted_outside_of_strings_only() {
        let text = r#"{"a": NaN, "b": [-Infinity, Infinity], "NaN \" NaN": "ä NaN\\", "c": NaN}"#;
        let value: Value = serde_json::from_str(&quote_non_finite(text)).unwrap();
        assert_eq!(value["a"], "NaN");
        assert_eq!(value["b"][0], "-Infinity");
        assert_eq!(value["NaN \" NaN"], "ä NaN\\");
        assert_eq!(value["c"], "NaN");
    }

    #[test]
    fn unfinished_escapes_do_not_panic() {
        for text in ["\"\\", "\"\\ä", "\"", "-", "\"\\\\"] {
            quote_non_finite(text);
        }
    }
}
