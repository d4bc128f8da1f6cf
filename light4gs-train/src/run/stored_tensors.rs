//! The tensors of a checkpoint's file, each checked before it is used.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

/// Key of the checksum over all other entries of the metadata. A file without it is accepted unchecked.
const CHECKSUM: &str = "checksum";
/// Prefix before a tensor's name in the key of its checksum.
const TENSOR_CHECKSUM: &str = "checksum.";

/// A tensor to store: shape and little-endian float32 bytes.
pub(super) type Entry = (Vec<usize>, Vec<u8>);

/// The index and the value of the first number that is not finite.
pub(super) fn not_finite(values: impl IntoIterator<Item = f32>) -> Option<(usize, f32)> {
    values.into_iter().enumerate().find(|(_, value)| !value.is_finite())
}

/// The numbers of little-endian float32 bytes.
pub(super) fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes))
}

/// A safetensors file of tensors and metadata, with checksums of both.
pub(super) fn serialize(
    entries: &BTreeMap<String, Entry>,
    mut metadata: HashMap<String, String>,
) -> Result<Vec<u8>, safetensors::SafeTensorError> {
    for (name, (_, bytes)) in entries {
        metadata.insert(format!("{TENSOR_CHECKSUM}{name}"), checksum_text(bytes));
    }
    metadata.insert(CHECKSUM.to_owned(), metadata_checksum(&metadata));
    let views = entries
        .iter()
        .map(|(name, (shape, bytes))| Ok((name, TensorView::new(Dtype::F32, shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()?;
    safetensors::serialize(views, Some(metadata))
}

fn checksum_text(bytes: &[u8]) -> String {
    format!("{:08x}", crc32c::crc32c(bytes))
}

fn metadata_checksum(metadata: &HashMap<String, String>) -> String {
    let sorted: BTreeMap<_, _> = metadata.iter().filter(|(key, _)| *key != CHECKSUM).collect();
    let text: String = sorted.into_iter().map(|(key, value)| format!("{key}\0{value}\0")).collect();
    checksum_text(text.as_bytes())
}

/// The contents of a checkpoint's file.
pub(super) struct StoredTensors<'a> {
    tensors: BTreeMap<String, TensorView<'a>>,
    metadata: HashMap<String, String>,
    taken: BTreeSet<String>,
}

impl<'a> StoredTensors<'a> {
    /// Finds the tensors in a file's bytes.
    ///
    /// # Errors
    /// As text: why the bytes are not such a file.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let unreadable = |error: safetensors::SafeTensorError| format!("it is not a whole safetensors file ({error})");
        let file = SafeTensors::deserialize(bytes).map_err(unreadable)?;
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(unreadable)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        Ok(Self { tensors: file.tensors().into_iter().collect(), metadata, taken: BTreeSet::new() })
    }

    /// An entry of the metadata.
    ///
    /// # Errors
    /// If it is missing.
    pub(super) fn text(&self, key: &str) -> Result<&str, String> {
        self.metadata.get(key).map(String::as_str).ok_or_else(|| format!("metadata `{key}` is missing"))
    }

    /// An entry of the metadata as a number.
    ///
    /// # Errors
    /// If it is missing, or is not a number.
    pub(super) fn number<T: std::str::FromStr>(&self, key: &str) -> Result<T, String> {
        let text = self.text(key)?;
        text.parse().map_err(|_| format!("metadata `{key}` is `{}`, expected a number", shorten(text)))
    }

    /// The rest of the names of tensors that begin with `prefix`.
    pub(super) fn names_after(&self, prefix: &str) -> Vec<String> {
        self.tensors.keys().filter_map(|name| name.strip_prefix(prefix)).map(str::to_owned).collect()
    }

    /// The rest of the keys of the metadata that begin with `prefix`, sorted.
    pub(super) fn keys_after(&self, prefix: &str) -> Vec<String> {
        let keys: BTreeSet<_> = self.metadata.keys().filter_map(|key| key.strip_prefix(prefix)).collect();
        keys.into_iter().map(str::to_owned).collect()
    }

    /// The number of rows that a tensor has, if it is there.
    pub(super) fn rows(&self, name: &str) -> Option<usize> {
        self.tensors.get(name)?.shape().first().copied()
    }

    /// Shapes of the tensors whose names begin with `prefix`, by the rest of the name: those that [`Self::take`]
    /// accepts. Each agrees with the number of values, which is at least one.
    pub(super) fn shapes_after(&self, prefix: &str) -> BTreeMap<String, Vec<usize>> {
        let numbers = self.tensors.iter().filter(|(_, view)| view.dtype() == Dtype::F32 && !view.shape().contains(&0));
        let shape =
            |(name, view): (&String, &TensorView)| Some((name.strip_prefix(prefix)?.to_owned(), view.shape().to_vec()));
        numbers.filter_map(shape).collect()
    }

    /// The values of a tensor of this shape.
    ///
    /// # Errors
    /// Why it cannot be used: missing, another type, another shape, or not finite.
    pub(super) fn take(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, String> {
        let wrong = |what: String| format!("tensor `{name}` {what}");
        let Some(view) = self.tensors.get(name) else { return Err(wrong("is missing".to_owned())) };
        if view.dtype() != Dtype::F32 {
            return Err(wrong(format!("has values of the type {:?}, expected float32", view.dtype())));
        }
        if view.shape() != shape {
            return Err(wrong(format!("has the shape {:?}, expected {shape:?}", view.shape())));
        }
        let values: Vec<f32> = floats(view.data()).collect();
        if let Some((index, value)) = not_finite(values.iter().copied()) {
            return Err(wrong(format!("has {value} at index {index}, expected finite numbers")));
        }
        self.taken.insert(name.to_owned());
        Ok(values)
    }

    /// Checks that no tensor is left over, and that every checksum is right.
    ///
    /// # Errors
    /// The tensor or entry that was not expected or has changed.
    pub(super) fn finish(self) -> Result<(), String> {
        if let Some(name) = self.tensors.keys().find(|name| !self.taken.contains(*name)) {
            return Err(format!("tensor `{}` belongs to no part of the run", shorten(name)));
        }
        let Some(expected) = self.metadata.get(CHECKSUM) else { return Ok(()) };
        for (name, view) in &self.tensors {
            let expected = self.text(&format!("{TENSOR_CHECKSUM}{name}"))?;
            if expected != checksum_text(view.data()) {
                return Err(format!("tensor `{name}` is damaged: its checksum is not the one that was written"));
            }
        }
        for name in self.keys_after(TENSOR_CHECKSUM) {
            if !self.tensors.contains_key(&name) {
                return Err(format!("tensor `{}` is missing", shorten(&name)));
            }
        }
        if *expected != metadata_checksum(&self.metadata) {
            return Err("its metadata is damaged: the checksum is not the one that was written".to_owned());
        }
        Ok(())
    }
}

/// At most 80 characters of a word from the file.
fn shorten(word: &str) -> String {
    word.chars().take(80).collect()
}
