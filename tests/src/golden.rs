//! Golden vectors: safetensors files whose names begin with the case and end with the set's letter.

use std::path::PathBuf;

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_train::device::{built_in, device_by_name};
use safetensors::{Dtype, SafeTensors};

/// The folder: `LIGHT4GS_GOLDEN`, or the copy in `tests/golden`.
pub fn directory() -> PathBuf {
    std::env::var_os("LIGHT4GS_GOLDEN")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/golden")), PathBuf::from)
}

/// One golden file in memory.
pub struct Golden {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Golden {
    /// Opens the file whose name is `case`, an underscore and the letter of the set, e.g. `c08_raster` for
    /// `c08_raster_a.safetensors`.
    ///
    /// # Panics
    /// If there is none: a missing golden file fails the test.
    pub fn open(case: &str) -> Self {
        let directory = directory();
        let entries = std::fs::read_dir(&directory).unwrap_or_else(|e| panic!("{}: {e}", directory.display()));
        let path = entries
            .map(|entry| entry.expect("readable folder").path())
            .find(|path| {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let Some(rest) = name.strip_prefix(case).and_then(|rest| rest.strip_prefix('_')) else { return false };
                rest.strip_suffix(".safetensors").is_some_and(|set| !set.contains('_'))
            })
            .unwrap_or_else(|| panic!("no golden file {case}_*.safetensors in {}", directory.display()));
        let bytes = std::fs::read(&path).expect("readable golden file");
        Self { path, bytes }
    }

    fn file(&self) -> SafeTensors<'_> {
        SafeTensors::deserialize(&self.bytes).expect("a golden file is valid safetensors")
    }

    /// Whether the file has a tensor.
    pub fn has(&self, name: &str) -> bool {
        self.file().tensor(name).is_ok()
    }

    /// Names of all tensors, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.file().names().iter().map(|name| name.to_string()).collect();
        names.sort();
        names
    }

    /// Shape of a tensor.
    pub fn shape(&self, name: &str) -> Vec<usize> {
        self.view(name, |view| view.shape().to_vec())
    }

    fn view<R>(&self, name: &str, read: impl Fn(safetensors::tensor::TensorView) -> R) -> R {
        read(self.file().tensor(name).unwrap_or_else(|_| panic!("{}: no tensor `{name}`", self.path.display())))
    }

    /// Values of a tensor of any stored type, as float32.
    pub fn values(&self, name: &str) -> Vec<f32> {
        self.view(name, |view| match view.dtype() {
            Dtype::F32 => view.data().as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
            Dtype::I32 => view.data().as_chunks().0.iter().map(|b| i32::from_le_bytes(*b) as f32).collect(),
            Dtype::U8 => view.data().iter().map(|b| f32::from(*b)).collect(),
            other => panic!("{name}: unexpected type {other:?}"),
        })
    }

    /// Values of an integer tensor.
    pub fn integers(&self, name: &str) -> Vec<i64> {
        self.values(name).into_iter().map(|v| v as i64).collect()
    }

    /// A scalar.
    pub fn scalar(&self, name: &str) -> f32 {
        self.values(name)[0]
    }

    /// A tensor on a device; leading dimensions of 1 are dropped or added to reach D.
    pub fn tensor<const D: usize>(&self, name: &str, device: &Device) -> Tensor<D> {
        let mut shape = self.shape(name);
        while shape.len() > D && shape[0] == 1 {
            shape.remove(0);
        }
        while shape.len() < D {
            shape.insert(0, 1);
        }
        Tensor::from_data(TensorData::new(self.values(name), shape), device)
    }
}

/// Every back end that is built, by name.
///
/// If there is no graphics adapter, not even a software one: the tests of a back end that cannot be tested must fail.
pub fn devices() -> Vec<(&'static str, Device)> {
    built_in().into_iter().map(|name| (name, device_by_name(name).unwrap_or_else(|error| panic!("{error}")))).collect()
}

/// The back ends among [`devices`] that compute on the processor.
pub fn cpu_devices() -> Vec<(&'static str, Device)> {
    devices().into_iter().filter(|(name, _)| *name != "wgpu").collect()
}

/// Row-major values of a tensor.
pub fn values_of<const D: usize>(tensor: &Tensor<D>) -> Vec<f32> {
    tensor.to_data().iter::<f32>().collect()
}

/// Fails unless the largest difference is at most `tolerance`.
#[track_caller]
pub fn assert_close(what: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len(), "{what}: number of values");
    let (mut worst, mut at) = (0.0f32, 0);
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        let difference = (f - e).abs();
        assert!(!difference.is_nan(), "{what}[{i}]: {f} against {e}");
        if difference > worst {
            (worst, at) = (difference, i);
        }
    }
    assert!(
        worst <= tolerance,
        "{what}[{at}]: {} against {}, off by {worst:e}, allowed {tolerance:e}",
        found[at],
        expected[at]
    );
}

/// Like [`assert_close`], with the tolerance a share of the largest expected magnitude.
#[track_caller]
pub fn assert_close_relative(what: &str, found: &[f32], expected: &[f32], share: f32) {
    let largest = expected.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    assert_close(what, found, expected, share * largest.max(1e-12));
}
