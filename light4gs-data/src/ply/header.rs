//! The text at the beginning of a PLY file.

use super::property::{Encoding, Property, Scalar};
use crate::error::DataError;
use std::io::{BufRead, Read};
use std::path::Path;

/// A header longer than this is refused.
const MAX_HEADER_BYTES: u64 = 64 * 1024;
/// More properties of a vertex than this are refused.
const MAX_PROPERTIES: usize = 1024;

/// The vertices as the header describes them.
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) rows: u64,
    pub(super) properties: Vec<Property>,
    /// What stands before the vertices.
    pub(super) before: Vec<Element>,
}

/// The rows of another element, which are passed over.
pub(super) struct Element {
    pub(super) name: String,
    pub(super) rows: u64,
    pub(super) values: Vec<Value>,
}

/// What a row of an element has for one property.
#[derive(Clone, Copy)]
pub(super) enum Value {
    One(Scalar),
    List { count: Scalar, each: Scalar },
}

/// At most the first 40 characters of a word from a file, for a message.
pub(super) fn shorten(word: &str) -> String {
    word.chars().take(40).collect()
}

/// One line without its end, or `None` at the end of the file. `too_long` gives the message for a line of `limit` bytes
/// or more.
pub(super) fn read_line(
    path: &Path,
    input: &mut impl BufRead,
    limit: u64,
    too_long: impl FnOnce() -> String,
) -> Result<Option<String>, DataError> {
    let mut bytes = Vec::new();
    input.by_ref().take(limit).read_until(b'\n', &mut bytes).map_err(DataError::io("read", path))?;
    if bytes.is_empty() {
        return Ok(None);
    }
    if bytes.len() as u64 == limit && bytes.last() != Some(&b'\n') {
        return Err(DataError::ply(path, too_long(), "this is not a PLY file that we can read: export it again"));
    }
    Ok(Some(String::from_utf8_lossy(&bytes).trim_end().to_string()))
}

pub(super) fn read_header(path: &Path, input: &mut impl BufRead) -> Result<Header, DataError> {
    let bad = |problem: String| DataError::ply(path, problem, "export it as ASCII or binary little endian PLY");
    let mut budget = MAX_HEADER_BYTES;
    let mut next_line = || -> Result<String, DataError> {
        let too_long = || format!("the header is longer than {MAX_HEADER_BYTES} bytes");
        let line = read_line(path, input, budget.max(1), too_long)?
            .ok_or_else(|| bad("the header has no `end_header`".into()))?;
        budget = budget.saturating_sub(line.len() as u64 + 1);
        if budget == 0 {
            return Err(bad(too_long()));
        }
        Ok(line)
    };
    if next_line()? != "ply" {
        return Err(bad("it does not begin with `ply`".into()));
    }
    let mut encoding = None;
    let mut rows = None;
    let mut properties: Vec<Property> = Vec::new();
    let mut before: Vec<Element> = Vec::new();
    let mut in_vertex = false;
    let scalar = |kind: &str| Scalar::parse(kind).ok_or_else(|| bad(format!("type `{}` is not known", shorten(kind))));
    let rows_of = |name: &str, count: &str| {
        let problem = || bad(format!("the count of `{}`, `{}`, is not a number", shorten(name), shorten(count)));
        count.parse::<u64>().map_err(|_| problem())
    };
    loop {
        let line = next_line()?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", kind, _version] => {
                encoding = Some(match *kind {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::BinaryLittleEndian,
                    other => {
                        return Err(bad(format!("format `{}` is not supported", shorten(other))));
                    }
                });
            }
            ["element", "vertex", count] => {
                if rows.is_some() {
                    return Err(bad("element `vertex` stands twice".into()));
                }
                rows = Some(rows_of("vertex", count)?);
                in_vertex = true;
            }
            ["element", name, count] => {
                if rows.is_none() {
                    before.push(Element { name: shorten(name), rows: rows_of(name, count)?, values: Vec::new() });
                }
                in_vertex = false;
            }
            ["property", ..] if !in_vertex && rows.is_some() => {}
            ["property", "list", ..] if in_vertex => {
                return Err(bad("vertices have a list property, expected scalars".into()));
            }
            ["property", kind, name] if in_vertex => {
                let scalar = scalar(kind)?;
                if properties.iter().any(|p| p.name == *name) {
                    return Err(bad(format!("property `{}` stands twice", shorten(name))));
                }
                if properties.len() == MAX_PROPERTIES {
                    return Err(bad(format!("vertices have more than {MAX_PROPERTIES} properties")));
                }
                properties.push(Property::new(*name, scalar));
            }
            ["property", kind @ .., _name] if !before.is_empty() && !in_vertex => {
                let value = match kind {
                    ["list", count, each] => Value::List { count: scalar(count)?, each: scalar(each)? },
                    [kind] => Value::One(scalar(kind)?),
                    _ => return Err(bad(format!("header line `{}` is not understood", shorten(&line)))),
                };
                before.last_mut().expect("there is one").values.push(value);
            }
            _ => {
                return Err(bad(format!("header line `{}` is not understood", shorten(&line))));
            }
        }
    }
    let encoding = encoding.ok_or_else(|| bad("the header has no `format` line".into()))?;
    let rows = rows.ok_or_else(|| bad("the header has no `element vertex` line".into()))?;
    if properties.is_empty() {
        return Err(bad("vertices have no properties".into()));
    }
    if properties.iter().any(|property| property.name == "packed_position") {
        return Err(DataError::ply(
            path,
            "it is a compressed PLY of SuperSplat and PlayCanvas (`packed_position`), which is not read",
            "export it as PLY without compression; the program splat-transform makes one of it: \
             `splat-transform scene.compressed.ply scene.ply`",
        ));
    }
    Ok(Header { encoding, rows, properties, before })
}
