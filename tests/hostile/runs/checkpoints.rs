//! Damage to checkpoints after which they are still safetensors files.

use std::collections::HashMap;

use rand::Rng;
use rand::seq::IndexedRandom;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

/// A checkpoint taken apart.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Texts by key.
    pub metadata: HashMap<String, String>,
    /// Name, type, shape and bytes of every tensor.
    pub tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
}

impl Parts {
    /// Takes a file apart.
    pub fn of(bytes: &[u8]) -> Self {
        let file = SafeTensors::deserialize(bytes).expect("a checkpoint");
        let (_, header) = SafeTensors::read_metadata(bytes).expect("a checkpoint");
        let mut tensors: Vec<_> = file
            .tensors()
            .into_iter()
            .map(|(name, view)| (name, view.dtype(), view.shape().to_vec(), view.data().to_vec()))
            .collect();
        tensors.sort_by(|a, b| a.0.cmp(&b.0));
        Self { metadata: header.metadata().clone().unwrap_or_default(), tensors }
    }

    /// Puts the checkpoint together again.
    pub fn to_bytes(&self) -> Vec<u8> {
        let views = self.tensors.iter().map(|(name, dtype, shape, bytes)| {
            (name.clone(), TensorView::new(*dtype, shape.clone(), bytes).expect("bytes of that shape"))
        });
        safetensors::serialize(views, Some(self.metadata.clone())).expect("a file")
    }

    /// Removes the checksums, as in a file of an older version. Then only the file's structure can be checked.
    pub fn without_checksums(mut self) -> Self {
        self.metadata.retain(|key, _| !key.starts_with("checksum"));
        self
    }
}

/// Changes a checkpoint in one of the ways that must be noticed, and says how. There is always a change.
pub fn mutate(parts: &Parts, random: &mut impl Rng) -> (Parts, String) {
    let mut out = parts.clone();
    let at = random.random_range(0..out.tensors.len());
    let (name, dtype, shape, bytes) = &mut out.tensors[at];
    let row = bytes.len() / shape.first().copied().unwrap_or(1).max(1);
    let what = match random.random_range(0..11) {
        0 if shape[0] > 0 => {
            shape[0] -= 1;
            bytes.truncate(bytes.len() - row);
            format!("`{name}` has a row less")
        }
        1 => {
            shape[0] += 1;
            bytes.extend(vec![0; row.max(4)]);
            bytes.truncate(4 * shape.iter().product::<usize>());
            format!("`{name}` has a row more")
        }
        2 if shape.len() > 1 && shape.iter().any(|side| *side != shape[0]) => {
            shape.reverse();
            format!("`{name}` is transposed")
        }
        3 => {
            shape.push(1);
            format!("`{name}` has a dimension more")
        }
        4 | 5 if !bytes.is_empty() => {
            let value = *[f32::NAN, f32::INFINITY, f32::NEG_INFINITY].choose(random).expect("some");
            let place = 4 * random.random_range(0..bytes.len() / 4);
            bytes[place..place + 4].copy_from_slice(&value.to_le_bytes());
            format!("`{name}` has {value} at {}", place / 4)
        }
        6 => {
            *dtype = Dtype::F16;
            bytes.truncate(bytes.len() / 2);
            format!("`{name}` is float16")
        }
        7 => {
            let name = out.tensors.remove(at).0;
            format!("`{name}` is missing")
        }
        8 => {
            let mut copy = out.tensors[at].clone();
            copy.0.push_str(".copy");
            let name = copy.0.clone();
            out.tensors.push(copy);
            format!("`{name}` is added")
        }
        9 => {
            let mut keys: Vec<String> = out.metadata.keys().cloned().collect();
            keys.retain(|key| !key.starts_with("checksum"));
            keys.sort();
            let key = keys.choose(random).expect("some").clone();
            out.metadata.remove(&key);
            format!("metadata `{key}` is missing")
        }
        _ => {
            let (key, value) = *[
                ("iteration", "99999999999"),
                ("iteration", "-1"),
                ("iteration", "18446744073709551616"),
                ("seconds", "NaN"),
                ("rate_weight", "-1"),
                ("seconds", "-5"),
                ("stage", "final"),
                ("stage", ""),
                ("field", "\u{1b}[31mred"),
                ("time.gaussians.means", "0"),
                ("time.gaussians.means", "4000000000"),
                ("time.nothing", "1"),
            ]
            .choose(random)
            .expect("some");
            out.metadata.insert(key.to_owned(), value.to_owned());
            format!("metadata `{key}` is `{value}`")
        }
    };
    (out, what)
}
