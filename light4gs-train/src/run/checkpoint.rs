//! Everything that a run needs to go on: parameters, moments, density statistics, position in the schedule.
//!
//! One safetensors file a checkpoint. Whatever is random in training is drawn from the seed and the iteration, so there
//! is no generator state to keep.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::path::{Path, PathBuf};

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::{DataError, PointCloud, write_atomically};
use light4gs_model::parameters::{ParameterMapper, ParameterVisitor, map_parameters, visit_parameters};
use light4gs_model::{DeformationField, DynamicScene, HexPlaneField};
use safetensors::{Dtype, SafeTensors};

use crate::compression::Compression;
use crate::config::Config;
use crate::error::TrainError;
use crate::optimization::adam::{Adam, AdamState};
use crate::optimization::parameters::{COMPRESSION, GaussianAttribute};
use crate::stage::Stage;

/// A run's state after an iteration.
#[derive(Debug)]
pub struct Checkpoint<F: DeformationField = HexPlaneField> {
    /// The model, on the run's device.
    pub scene: DynamicScene<F>,
    /// Entropy models and quantization steps, where the run trains them.
    pub compression: Option<Compression>,
    /// Optimizer state.
    pub adam: Adam,
    /// What the density strategy keeps, by name: vectors off the tape.
    pub density: BTreeMap<String, Tensor<1>>,
    /// The stage that the iteration belongs to.
    pub stage: Stage,
    /// Iterations done in that stage.
    pub iteration: usize,
    /// Seconds of training so far.
    pub seconds: f64,
}

/// A stored tensor: shape and little-endian float32 bytes.
type Entry = (Vec<usize>, Vec<u8>);

fn entry<const D: usize>(tensor: Tensor<D>) -> Entry {
    let shape = tensor.dims().to_vec();
    (shape, tensor.into_data().iter::<f32>().flat_map(f32::to_le_bytes).collect())
}

/// Tensors to store, by name.
struct Collect<'a> {
    prefix: &'static str,
    entries: &'a mut BTreeMap<String, Entry>,
}

impl ParameterVisitor for Collect<'_> {
    fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
        self.entries.insert(format!("{}.{path}", self.prefix), entry(parameter.val()));
    }
}

/// Names of the stored parameters: those of the scene, and those of the entropy models, begin like this.
const SCENE: &str = "scene";

impl<F: DeformationField> Checkpoint<F> {
    /// File name of a checkpoint.
    pub fn file_name(stage: Stage, iteration: usize) -> String {
        format!("{}_{iteration:06}.safetensors", stage.name())
    }

    /// Writes the file whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), TrainError> {
        let mut entries = BTreeMap::new();
        visit_parameters(&self.scene, &mut Collect { prefix: SCENE, entries: &mut entries });
        if let Some(compression) = &self.compression {
            visit_parameters(compression, &mut Collect { prefix: COMPRESSION, entries: &mut entries });
        }
        let mut metadata = HashMap::from([
            ("field".to_owned(), F::KIND.to_owned()),
            ("stage".to_owned(), self.stage.name().to_owned()),
            ("iteration".to_owned(), self.iteration.to_string()),
            ("seconds".to_owned(), self.seconds.to_string()),
        ]);
        for (name, state) in &self.adam.states {
            entries.insert(format!("first.{name}"), entry(state.first.clone()));
            entries.insert(format!("second.{name}"), entry(state.second.clone()));
            metadata.insert(format!("time.{name}"), state.time.to_string());
        }
        for (name, tensor) in &self.density {
            entries.insert(format!("density.{name}"), entry(tensor.clone()));
        }

        let failed = |problem: String| TrainError::Checkpoint { path: path.to_owned(), problem };
        let views = entries
            .iter()
            .map(|(name, (shape, bytes))| {
                Ok((name, safetensors::tensor::TensorView::new(Dtype::F32, shape.clone(), bytes)?))
            })
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(|error| failed(error.to_string()))?;
        let bytes = safetensors::serialize(views, Some(metadata)).map_err(|error| failed(error.to_string()))?;
        Ok(write_atomically(path, |file| file.write_all(&bytes))?)
    }

    /// Reads a checkpoint of a run with this configuration and this deformation field onto an autodiff device.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] naming the tensor that is missing or of another shape, or the other kind of field.
    pub fn load(path: &Path, config: &Config, field: &F::Config, device: &Device) -> Result<Self, TrainError> {
        let bytes =
            std::fs::read(path).map_err(|source| DataError::Io { action: "read", path: path.to_owned(), source })?;
        let failed = |problem: String| TrainError::Checkpoint { path: path.to_owned(), problem };
        let file = SafeTensors::deserialize(&bytes).map_err(|error| failed(error.to_string()))?;
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| failed(error.to_string()))?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let text = |key: &str| metadata.get(key).ok_or_else(|| failed(format!("`{key}` is missing")));
        fn number<T: std::str::FromStr>(text: &str) -> Result<T, String> {
            text.parse().map_err(|_| format!("`{text}` is not a number"))
        }
        let stage = match text("stage")?.as_str() {
            "coarse" => Stage::Coarse,
            "fine" => Stage::Fine,
            other => return Err(failed(format!("unknown stage `{other}`"))),
        };
        let kind = text("field")?;
        if kind != F::KIND {
            return Err(failed(format!("it has a deformation field of the kind `{kind}`, not `{}`", F::KIND)));
        }

        // A model of the right structure, whose tensors are then replaced.
        let cloud = PointCloud { positions: vec![[0.0; 3]], colors: vec![[0.5; 3]] };
        let mut scene = config.model.scene::<F>(field.clone()).init(&cloud, device);
        let mut compression = Compression::of_run(config, scene.planes(), device)?;
        let mut load = Load { prefix: SCENE, file: &file, device, problem: None };
        scene = map_parameters(scene, &mut load);
        load.prefix = COMPRESSION;
        compression = compression.map(|compression| map_parameters(compression, &mut load));
        let inner = device.clone().inner();
        let vector = |values: Vec<f32>| {
            let shape = [values.len()];
            Tensor::<1>::from_data(TensorData::new(values, shape), &inner)
        };
        let mut adam = Adam::default();
        for (key, time) in metadata.iter().filter_map(|(key, value)| Some((key.strip_prefix("time.")?, value))) {
            let (first, second) =
                (load.values(&format!("first.{key}"), None), load.values(&format!("second.{key}"), None));
            let time = number(time).map_err(failed)?;
            adam.states.insert(key.to_owned(), AdamState { first: vector(first), second: vector(second), time });
        }
        let mut density = BTreeMap::new();
        for name in file.names().into_iter().filter_map(|name| name.strip_prefix("density.")) {
            density.insert(name.to_owned(), vector(load.values(&format!("density.{name}"), None)));
        }
        if let Some(problem) = load.problem {
            return Err(failed(problem));
        }
        Ok(Self {
            scene,
            compression,
            adam,
            density,
            stage,
            iteration: number(text("iteration")?).map_err(failed)?,
            seconds: number(text("seconds")?).map_err(failed)?,
        })
    }
}

struct Load<'a> {
    prefix: &'static str,
    file: &'a SafeTensors<'a>,
    device: &'a Device,
    problem: Option<String>,
}

impl Load<'_> {
    /// Values of a float32 tensor; the first problem is remembered and zeros are returned for it.
    fn values(&mut self, name: &str, expected: Option<usize>) -> Vec<f32> {
        let found = self.file.tensor(name).ok().filter(|view| view.dtype() == Dtype::F32);
        let values: Option<Vec<f32>> =
            found.map(|view| view.data().as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect());
        match values {
            Some(values) if expected.is_none_or(|expected| expected == values.len()) => values,
            found => {
                let found = found.map_or("nothing".to_owned(), |values| format!("{} values", values.len()));
                let wanted = expected.map_or("float32 values".to_owned(), |n| format!("{n} float32 values"));
                self.problem.get_or_insert(format!("tensor `{name}`: expected {wanted}, found {found}"));
                vec![0.0; expected.unwrap_or(0)]
            }
        }
    }
}

impl ParameterMapper for Load<'_> {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let key = format!("{}.{path}", self.prefix);
        // The shape is what the configuration says, but for the number of Gaussians.
        let mut shape = parameter.dims();
        if GaussianAttribute::has_path(path)
            && let Ok(view) = self.file.tensor(&key)
        {
            shape[0] = view.shape().first().copied().unwrap_or(0);
        }
        let values = self.values(&key, Some(shape.iter().product()));
        if self.problem.is_some() {
            return parameter;
        }
        let trains = parameter.is_require_grad();
        let tensor = Tensor::<D>::from_data(TensorData::new(values, shape), self.device);
        Param::initialized(parameter.id, tensor.set_require_grad(trains))
    }
}

/// Checkpoints in a folder, oldest first.
pub fn list_checkpoints(folder: &Path) -> Vec<PathBuf> {
    let position = |path: &PathBuf| {
        let name = path.file_stem()?.to_str()?;
        let (stage, iteration) = name.split_once('_')?;
        let stage = match stage {
            "coarse" => Stage::Coarse,
            "fine" => Stage::Fine,
            _ => return None,
        };
        Some((stage, iteration.parse::<usize>().ok()?))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|e| e == "safetensors"))
        .filter_map(|path| Some((position(&path)?, path)))
        .collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}
