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
use light4gs_model::{DynamicScene, Pca, SceneCoordinates};
use safetensors::{Dtype, SafeTensors};

use crate::compression::Compression;
use crate::config::Config;
use crate::error::TrainError;
use crate::optimization::adam::{Adam, AdamState};
use crate::optimization::parameters::{ParameterGroup, ParameterVisitor, visit_compression, visit_parameters};
use crate::stage::Stage;

/// A run's state after an iteration.
#[derive(Debug)]
pub struct Checkpoint {
    /// The model, on the run's device.
    pub scene: DynamicScene,
    /// Entropy models and quantisation steps, where the run trains them.
    pub compression: Option<Compression>,
    /// Optimiser state.
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

struct Collect(BTreeMap<String, Entry>);

impl ParameterVisitor for Collect {
    fn visit<const D: usize>(&mut self, _: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>) {
        self.0.insert(format!("parameter.{name}"), entry(parameter.val()));
    }
}

impl Checkpoint {
    /// File name of a checkpoint.
    pub fn file_name(stage: Stage, iteration: usize) -> String {
        format!("{}_{iteration:06}.safetensors", stage.name())
    }

    /// Writes the file whole or not at all.
    pub fn save(&mut self, path: &Path) -> Result<(), TrainError> {
        let mut collect = Collect(BTreeMap::new());
        visit_parameters(&mut self.scene, &mut collect);
        if let Some(compression) = &mut self.compression {
            visit_compression(compression, &mut collect);
        }
        let mut entries = collect.0;
        let Pca { mean, axes, std } = self.scene.coordinates.pca();
        let frame: Vec<u8> =
            [mean.as_slice(), axes.as_flattened(), &std].concat().iter().flat_map(|v| v.to_le_bytes()).collect();
        entries.insert("frame".into(), (vec![5, 3], frame));
        let mut metadata = HashMap::from([
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

    /// Reads a checkpoint of a run with this configuration onto an autodiff device.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] naming the tensor that is missing or of another shape.
    pub fn load(path: &Path, config: &Config, device: &Device) -> Result<Self, TrainError> {
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

        // A model of the right structure, whose tensors are then replaced.
        let cloud = PointCloud { positions: vec![[0.0; 3]], colors: vec![[0.5; 3]] };
        let mut scene = config.model.build().init(&cloud, device);
        let mut load = Load { file: &file, device, problem: None };
        visit_parameters(&mut scene, &mut load);
        let mut compression = Compression::of_run(config, device);
        if let Some(compression) = &mut compression {
            visit_compression(compression, &mut load);
        }
        let inner = device.clone().inner();
        let frame = load.values("frame", Some(15));
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
        let triple = |k: usize| [frame[3 * k], frame[3 * k + 1], frame[3 * k + 2]];
        let pca = Pca { mean: triple(0), axes: [triple(1), triple(2), triple(3)], std: triple(4) };
        scene.coordinates = SceneCoordinates::new(&pca, device);
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

impl ParameterVisitor for Load<'_> {
    fn visit<const D: usize>(&mut self, group: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>) {
        let key = format!("parameter.{name}");
        let mut shape = parameter.dims();
        if group.is_per_gaussian()
            && let Ok(view) = self.file.tensor(&key)
        {
            shape[0] = view.shape().first().copied().unwrap_or(0);
        }
        let values = self.values(&key, Some(shape.iter().product()));
        if self.problem.is_none() {
            let tensor = Tensor::<D>::from_data(TensorData::new(values, shape), self.device);
            *parameter = Param::initialized(parameter.id, tensor.require_grad());
        }
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
