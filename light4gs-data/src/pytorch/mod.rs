//! Tensors in PyTorch's files (`.pth`, `.pt`), read without executing anything.
//!
//! Such a file is a pickle, which is a program: Python's own reader calls whatever it names. This reader knows the few
//! instructions of a saved state dict, and no call except those that put a tensor together. Any other is refused by
//! name.
//!
//! - this file: what is read, and from which containers
//! - `archive`: today's container, a ZIP file
//! - `legacy`: the container of PyTorch before 1.6
//! - `pickle`: the instructions
//! - `storage`: numbers of every type

mod archive;
mod legacy;
mod pickle;
mod storage;

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::DataError;
use crate::regular_file::read_regular_file;
use pickle::{Arena, Id, Object};
use storage::Storages;

/// How deeply state dicts may be nested.
const MAX_DEPTH: usize = 8;

/// A tensor as plain numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct PlainTensor {
    /// Lengths of the axes, outermost first; empty for a scalar.
    pub shape: Vec<usize>,
    /// Row-major; integers and booleans are converted.
    pub values: Vec<f32>,
}

/// What is wrong in a file, and where. The caller makes it a [`DataError`] with the file's name.
type Problem = (String, String);

const REMEDY: &str = "copy it again, or save it anew with `torch.save(model.state_dict(), path)`";

fn problem(field: impl Into<String>, problem: impl Into<String>) -> Problem {
    (field.into(), problem.into())
}

/// Reads every tensor of a file by its name. Names of nested dictionaries are joined by dots; a tensor that is the
/// whole file has the name "".
///
/// # Errors
/// [`DataError::Io`] when the file cannot be read; [`DataError::Field`] when it is no PyTorch file, is damaged, or
/// calls any function other than those that rebuild a tensor.
pub fn read_pytorch(path: &Path) -> Result<BTreeMap<String, PlainTensor>, DataError> {
    let bytes = read_regular_file(path, u64::MAX).map_err(DataError::io("read", path))?;
    read_bytes(&bytes).map_err(|(field, problem)| DataError::field(path, field, problem, REMEDY))
}

fn read_bytes(bytes: &[u8]) -> Result<BTreeMap<String, PlainTensor>, Problem> {
    let saved = match bytes {
        [b'P', b'K', ..] => archive::read(bytes)?,
        [0x80, ..] => legacy::read(bytes)?,
        _ => return Err(problem("first bytes", "neither a ZIP archive nor a pickle: this is no PyTorch file")),
    };
    let mut found = Found { saved: &saved, tensors: BTreeMap::new(), budget: 4 * bytes.len() };
    found.collect(saved.root, String::new(), 0)?;
    Ok(found.tensors)
}

/// The parts of a file.
struct Saved<'a> {
    arena: Arena,
    root: Id,
    storages: Storages<'a>,
}

struct Found<'a> {
    saved: &'a Saved<'a>,
    tensors: BTreeMap<String, PlainTensor>,
    /// The numbers that may still be read: tensors may share a storage, but no real file has many more numbers than
    /// bytes.
    budget: usize,
}

impl Found<'_> {
    fn collect(&mut self, id: Id, name: String, depth: usize) -> Result<(), Problem> {
        let arena = &self.saved.arena;
        match arena.get(id) {
            Object::Tensor(view) => {
                let tensor = self.saved.storages.tensor(view, &name, &mut self.budget)?;
                self.tensors.insert(name, tensor);
            }
            Object::Dict(entries) if depth < MAX_DEPTH => {
                let left = self.budget.checked_sub(entries.len());
                self.budget = left.ok_or_else(|| problem(&*name, "it holds the same things too often"))?;
                for (key, value) in entries {
                    let key = match arena.get(*key) {
                        Object::Text(text) => text.clone(),
                        Object::Integer(number) => number.to_string(),
                        _ => continue,
                    };
                    let name = if name.is_empty() { key } else { format!("{name}.{key}") };
                    self.collect(*value, name, depth + 1)?;
                }
            }
            // Settings beside the tensors: numbers, texts, lists of them.
            _ => {}
        }
        Ok(())
    }
}
