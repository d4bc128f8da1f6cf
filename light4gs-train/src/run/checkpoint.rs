//! Everything that a run needs to continue: parameters, moments, density statistics, training position.
//!
//! Each checkpoint is one safetensors file. All random numbers of training are drawn from the seed and the iteration,
//! so there is no generator state to store.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::path::{Path, PathBuf};

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::CoordinateMapping;
use light4gs_data::{DataError, PointCloud, read_regular_file, write_atomically};
use light4gs_model::attributes::{MEANS, attribute_of_path};
use light4gs_model::parameters::{ParameterMapper, ParameterVisitor, map_parameters, visit_parameters};
use light4gs_model::{Attribute, BuiltInField, DeformationField, DynamicScene, DynamicSceneConfig, Gaussians};

use super::stored_tensors::{self, Entry, StoredTensors, floats, not_finite};
use crate::compression::{Compression, CompressionOf, ConfiguredModels, EntropyModels};
use crate::config::Config;
use crate::error::TrainError;
use crate::optimization::adam::{Adam, AdamState};
use crate::optimization::parameters::{COMPRESSION, ParameterGroup};
use crate::stage::Stage;

/// A run's state after an iteration.
#[derive(Debug)]
pub struct Checkpoint<F: DeformationField = BuiltInField, E: EntropyModels = ConfiguredModels> {
    /// The model, on the run's device.
    pub scene: DynamicScene<F>,
    /// Entropy models and quantization steps, where the run trains them.
    pub compression: Option<CompressionOf<E>>,
    /// Optimizer state.
    pub adam: Adam,
    /// The state of the density strategy, by name: vectors without a tape.
    pub density: BTreeMap<String, Tensor<1>>,
    /// The corrections of the capture, by name: see [`Corrections`](crate::corrections::Corrections).
    pub corrections: BTreeMap<String, Vec<f32>>,
    /// The stage that the iteration belongs to.
    pub stage: Stage,
    /// Iterations done in that stage.
    pub iteration: usize,
    /// Seconds of training so far.
    pub seconds: f64,
    /// Factor of the configured weight of the rate, by which training reaches a wished size or quality; 1 without a wish.
    pub rate_weight: f64,
}

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

/// Prefix of the names of the scene's stored parameters; that of the entropy models is [`COMPRESSION`].
const SCENE: &str = "scene";
/// Prefixes before a parameter's name: for the optimizer's first moment, its second moment, and the number of its
/// steps.
const FIRST: &str = "first.";
const SECOND: &str = "second.";
const TIME: &str = "time.";
/// Prefix of the names of the density strategy's statistics.
const DENSITY: &str = "density.";
/// Prefix of the names of the corrections of exposures, poses and times.
const CORRECTIONS: &str = "corrections.";

/// Key of the weight of the rate, which is stored if it is not 1.
const RATE_WEIGHT: &str = "rate_weight";
/// Key of the coordinate mapping, which is stored if it is not the paper's.
const MAPPING: &str = "coordinate_mapping";

/// Contraction, scales, offsets, scale and offset of the time: nine numbers.
fn mapping_text(mapping: &CoordinateMapping) -> String {
    let CoordinateMapping { contracts, scale, offset, time_scale, time_offset } = *mapping;
    let numbers =
        [f32::from(u8::from(contracts))].into_iter().chain(scale).chain(offset).chain([time_scale, time_offset]);
    numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(" ")
}

fn parsed_mapping(text: &str) -> Option<CoordinateMapping> {
    let numbers = text.split(' ').map(|word| word.parse().ok()).collect::<Option<Vec<f32>>>()?;
    let [contracts, x, y, z, dx, dy, dz, time_scale, time_offset] = numbers[..] else { return None };
    let finite = numbers.iter().all(|number| number.is_finite());
    let (scale, offset) = ([x, y, z], [dx, dy, dz]);
    finite.then_some(CoordinateMapping { contracts: contracts != 0.0, scale, offset, time_scale, time_offset })
}

impl<F: DeformationField, E: EntropyModels> Checkpoint<F, E> {
    /// Everything that is stored, by name.
    fn entries(&self) -> BTreeMap<String, Entry> {
        let mut entries = BTreeMap::new();
        visit_parameters(&self.scene, &mut Collect { prefix: SCENE, entries: &mut entries });
        if let Some(compression) = &self.compression {
            visit_parameters(compression, &mut Collect { prefix: COMPRESSION, entries: &mut entries });
        }
        for (name, state) in &self.adam.states {
            entries.insert(format!("{FIRST}{name}"), entry(state.first.clone()));
            entries.insert(format!("{SECOND}{name}"), entry(state.second.clone()));
        }
        for (name, tensor) in &self.density {
            entries.insert(format!("{DENSITY}{name}"), entry(tensor.clone()));
        }
        for (name, values) in &self.corrections {
            let bytes = values.iter().copied().flat_map(f32::to_le_bytes).collect();
            entries.insert(format!("{CORRECTIONS}{name}"), (vec![values.len()], bytes));
        }
        entries
    }

    /// Writes the file whole or not at all. A checkpoint is not written if a number is not finite, or so large that
    /// [`Checkpoint::load`] would refuse it. So a run can always continue from the last checkpoint.
    ///
    /// # Errors
    /// [`SaveError::NotFinite`] with the tensor; what the system refuses.
    pub fn save(&self, path: &Path) -> Result<(), SaveError> {
        let entries = self.entries();
        for (name, (_, bytes)) in &entries {
            let moment = [FIRST, SECOND, DENSITY, CORRECTIONS].iter().any(|prefix| name.starts_with(prefix));
            let too_large = || {
                let found = floats(bytes).enumerate().find(|(_, value)| value.abs() > LARGEST_VALUE);
                found.filter(|_| !moment)
            };
            if let Some((index, value)) = not_finite(floats(bytes)).or_else(too_large) {
                return Err(SaveError::NotFinite { tensor: name.clone(), index, value });
            }
        }
        let mut metadata = HashMap::from([
            ("field".to_owned(), self.scene.field.kind().to_owned()),
            ("stage".to_owned(), self.stage.name().to_owned()),
            ("iteration".to_owned(), self.iteration.to_string()),
            ("seconds".to_owned(), self.seconds.to_string()),
        ]);
        if self.rate_weight != 1.0 {
            metadata.insert(RATE_WEIGHT.to_owned(), self.rate_weight.to_string());
        }
        let mapping = self.scene.coordinates.mapping();
        if mapping != CoordinateMapping::default() {
            metadata.insert(MAPPING.to_owned(), mapping_text(&mapping));
        }
        for (name, state) in &self.adam.states {
            metadata.insert(format!("{TIME}{name}"), state.time.to_string());
        }
        let bytes = stored_tensors::serialize(&entries, metadata)
            .map_err(|error| TrainError::Checkpoint { path: path.to_owned(), problem: error.to_string() })?;
        Ok(write_atomically(path, |file| file.write_all(&bytes)).map_err(TrainError::from)?)
    }

    /// Reads a checkpoint of a run with this configuration, scene and entropy models onto an autodiff device. The scene
    /// is that of the run before training: it gives the deformation field and the attributes of the Gaussians.
    ///
    /// Nothing in the file is trusted: exactly the expected tensors must be there, with the shapes that follow from the
    /// configuration and the number of Gaussians, and with finite values that training can have produced. The training
    /// position must be within the schedule.
    ///
    /// # Errors
    /// [`TrainError::Checkpoint`] with the name of the tensor or the entry, or of the other kind of field.
    pub fn load(
        path: &Path,
        config: &Config,
        scene: &DynamicSceneConfig<F>,
        models: &E,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let bytes = read_regular_file(path, u64::MAX).map_err(DataError::io("read", path))?;
        let failed = |problem: String| TrainError::Checkpoint { path: path.to_owned(), problem };
        let mut file = StoredTensors::new(&bytes).map_err(failed)?;
        let (stage, iteration) = place(&file, path, config).map_err(failed)?;
        let seconds = file.number::<f64>("seconds").map_err(failed)?;
        if !(seconds.is_finite() && seconds >= 0.0) {
            return Err(failed(format!("metadata `seconds` is {seconds}, expected a duration")));
        }

        let rate_weight = match file.text(RATE_WEIGHT) {
            Ok(_) => file.number::<f64>(RATE_WEIGHT).map_err(failed)?,
            Err(_) => 1.0,
        };
        if !(rate_weight.is_finite() && rate_weight > 0.0) {
            return Err(failed(format!("metadata `{RATE_WEIGHT}` is {rate_weight}, expected a weight")));
        }

        // A model of the right structure, whose tensors are replaced afterwards.
        let cloud = PointCloud { positions: vec![[0.0; 3]], colors: vec![[0.5; 3]] };
        let mut scene = scene.init(&cloud, device);
        let (kind, expected) = (file.text("field").map_err(failed)?, scene.field.kind());
        if kind != expected {
            return Err(failed(format!("it has a deformation field of the kind `{kind}`, not `{expected}`")));
        }
        if stage == Stage::Fine {
            // Motion has begun, so the shapes of the field may have changed.
            let shapes = file.shapes_after(&format!("{SCENE}.field."));
            scene.field.resize(&shapes).map_err(|error| failed(error.to_string()))?;
        }
        if let Ok(text) = file.text(MAPPING) {
            let wrong = || failed(format!("metadata `{MAPPING}` is `{text}`, expected nine numbers"));
            scene.coordinates = scene.coordinates.with_mapping(parsed_mapping(text).ok_or_else(wrong)?);
        }
        let mut compression = Compression::of_run(models, config, &scene, device)?;
        let count = gaussian_count(&file, &scene.gaussians);
        if count == 0 {
            let means = MEANS.path();
            return Err(failed(format!("tensor `{SCENE}.{means}` has no rows, expected at least one Gaussian")));
        }
        let mut load = Load { prefix: SCENE, count, file: &mut file, device, sizes: BTreeMap::new(), problem: None };
        scene = map_parameters(scene, &mut load);
        load.prefix = COMPRESSION;
        compression = compression.map(|compression| map_parameters(compression, &mut load));
        let Load { sizes, problem, .. } = load;
        if let Some(problem) = problem {
            return Err(failed(problem));
        }
        let inner = device.clone().inner();
        let adam = load_adam(&mut file, &sizes, iteration, &inner).map_err(failed)?;
        let mut density = BTreeMap::new();
        for name in file.names_after(DENSITY) {
            let stored = format!("{DENSITY}{name}");
            let values = file.take(&stored, &[file.rows(&stored).unwrap_or(0)]).map_err(failed)?;
            density.insert(name, vector(values, &inner));
        }
        let mut corrections = BTreeMap::new();
        for name in file.names_after(CORRECTIONS) {
            let stored = format!("{CORRECTIONS}{name}");
            corrections.insert(name, file.take(&stored, &[file.rows(&stored).unwrap_or(0)]).map_err(failed)?);
        }
        file.finish().map_err(failed)?;
        Ok(Self { scene, compression, adam, density, corrections, stage, iteration, seconds, rate_weight })
    }
}

/// Why a checkpoint was not written.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// A number is not finite, or beyond what the encoder accepts.
    #[error("tensor `{tensor}` has {value} at index {index}")]
    NotFinite {
        /// Its name in the file.
        tensor: String,
        /// Of the flattened tensor.
        index: usize,
        /// NaN, an infinity, or a number beyond 1e30.
        value: f32,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Other(#[from] TrainError),
}

fn vector(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let shape = [values.len()];
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// The number of rows that most attributes of the Gaussians have, so that the error names the one that differs.
fn gaussian_count(file: &StoredTensors, gaussians: &Gaussians) -> usize {
    let rows = |attribute: &Attribute| file.rows(&format!("{SCENE}.{}", attribute.path())).unwrap_or(0);
    let rows: Vec<usize> = gaussians.attributes().map(rows).collect();
    let having = |count: usize| rows.iter().filter(|rows| **rows == count).count();
    rows.iter().copied().max_by_key(|count| having(*count)).unwrap_or(0)
}

/// The training position of a checkpoint; it must be within the schedule, and that of the file's name.
fn place(file: &StoredTensors, path: &Path, config: &Config) -> Result<(Stage, usize), String> {
    let stage = match file.text("stage")? {
        "coarse" => Stage::Coarse,
        "fine" => Stage::Fine,
        other => return Err(format!("metadata `stage` is `{other}`, expected `coarse` or `fine`")),
    };
    let iteration = file.number("iteration")?;
    let iterations = config.train.iterations(stage);
    if iteration > iterations {
        return Err(format!(
            "metadata `iteration` is {iteration}, but the {stage} stage of this run has {iterations} \
             (`train.{stage}_iterations`)"
        ));
    }
    match place_by_name(path) {
        Some(named) if named != (stage, iteration) => Err(format!(
            "its name is not that of the {stage} stage's iteration {iteration}, where its metadata says it is"
        )),
        _ => Ok((stage, iteration)),
    }
}

/// The optimizer's state. `sizes` are the lengths of all parameters.
fn load_adam(
    file: &mut StoredTensors,
    sizes: &BTreeMap<String, usize>,
    iteration: usize,
    device: &Device,
) -> Result<Adam, String> {
    let mut adam = Adam::default();
    for name in file.keys_after(TIME) {
        let size = match sizes.get(&name) {
            Some(size) if ParameterGroup::of(&name).is_some() => *size,
            _ => return Err(format!("metadata `{TIME}{name}` belongs to no parameter that is trained")),
        };
        let time: u32 = file.number(&format!("{TIME}{name}"))?;
        if time == 0 || time as usize > iteration {
            return Err(format!("metadata `{TIME}{name}` is {time}, expected 1 to {iteration}, the iterations done"));
        }
        let first = file.take(&format!("{FIRST}{name}"), &[size])?;
        let second = file.take(&format!("{SECOND}{name}"), &[size])?;
        if let Some(index) = second.iter().position(|value| *value < 0.0) {
            let value = second[index];
            return Err(format!("tensor `{SECOND}{name}` has {value} at index {index}, expected a mean of squares"));
        }
        adam.states.insert(name, AdamState { first: vector(first, device), second: vector(second, device), time });
    }
    Ok(adam)
}

struct Load<'a, 'f> {
    prefix: &'static str,
    /// Gaussians.
    count: usize,
    file: &'a mut StoredTensors<'f>,
    device: &'a Device,
    /// Length of each parameter, by the name that its moments have.
    sizes: BTreeMap<String, usize>,
    /// The first one that was found.
    problem: Option<String>,
}

impl ParameterMapper for Load<'_, '_> {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        if self.problem.is_some() {
            return parameter;
        }
        // The shape follows from the configuration, except for the number of Gaussians.
        let mut shape = parameter.dims();
        if attribute_of_path(path).is_some() {
            shape[0] = self.count;
        }
        let key = format!("{}.{path}", self.prefix);
        let values = self.file.take(&key, &shape).and_then(|values| {
            check_range(path, &values).map_err(|problem| format!("tensor `{key}` {problem}"))?;
            Ok(values)
        });
        let values = match values {
            Ok(values) => values,
            Err(problem) => {
                self.problem = Some(problem);
                return parameter;
            }
        };
        self.sizes.insert(if self.prefix == SCENE { path.to_owned() } else { key }, values.len());
        let trains = parameter.is_require_grad();
        let tensor = Tensor::<D>::from_data(TensorData::new(values, shape), self.device);
        Param::initialized(parameter.id, tensor.set_require_grad(trains))
    }
}

/// The largest position and the largest weight that the encoder accepts (see `light4gs_codec::checks::positions`).
const LARGEST_VALUE: f32 = 1e30;

/// Conditions on finite values, by the path of their parameter.
fn check_range(path: &str, values: &[f32]) -> Result<(), String> {
    let bad = |unit: usize, holds: &dyn Fn(&[f32]) -> bool| values.chunks(unit).position(|row| !holds(row));
    let length = |row: &[f32]| row.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    let (row, expected) = match path {
        "gaussians.quats" => (bad(4, &|row| length(row) > 0.0), "a quaternion that is not zero"),
        "coordinates.std" => (bad(1, &|row| row[0] > 0.0), "a standard deviation above 0"),
        "coordinates.axes" => (bad(3, &|row| (length(row) - 1.0).abs() < 1e-3), "an axis of length 1"),
        _ => (None, ""),
    };
    // Finite numbers that the encoder would refuse, but only after the last iteration.
    if let Some(index) = values.iter().position(|value| value.abs() > LARGEST_VALUE) {
        return Err(format!(
            "has {:e} at index {index}, expected at most {LARGEST_VALUE:e} on either side of 0",
            values[index]
        ));
    }
    row.map_or(Ok(()), |row| Err(format!("has, in row {row}, something else than {expected}")))
}

/// File name of a checkpoint.
pub fn checkpoint_name(stage: Stage, iteration: usize) -> String {
    format!("{}_{iteration:06}.safetensors", stage.name())
}

/// Stage and iteration from a checkpoint's name.
fn place_by_name(path: &Path) -> Option<(Stage, usize)> {
    let (stage, iteration) = path.file_stem()?.to_str()?.split_once('_')?;
    let stage = [Stage::Coarse, Stage::Fine].into_iter().find(|known| known.name() == stage)?;
    Some((stage, iteration.parse().ok()?))
}

/// Checkpoints in a folder, oldest first.
pub fn list_checkpoints(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|e| e == "safetensors"))
        .filter_map(|path| Some((place_by_name(&path)?, path)))
        .collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

#[cfg(test)]
mod tests {
    use light4gs_codec::GaussianArrays;

    use super::*;

    /// A scene of two Gaussians with a further attribute of this width, if any.
    fn scene(config: &Config, width: Option<usize>) -> DynamicSceneConfig<BuiltInField> {
        let mut scene = config.model.build();
        let start = |width| Attribute::new("age", width).with_start((0..width).map(|i| i as f32).collect());
        scene.gaussians.further.extend(width.map(start));
        scene
    }

    #[test]
    fn further_attributes_are_kept_and_their_shapes_checked() {
        let mut config = Config::default();
        config.model.fields.hexplane.hexplane.channels = 2;
        config.model.fields.hexplane.hexplane.resolution = [8, 8, 8, 4];
        let device = Device::flex().autodiff();
        let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.5, 2.0]], colors: vec![[0.5; 3]; 2] };
        let zeros = || vector(vec![0.0; 4], &device.clone().inner());
        let state = AdamState { first: zeros(), second: zeros(), time: 1 };
        let checkpoint = Checkpoint::<BuiltInField> {
            scene: scene(&config, Some(2)).init(&cloud, &device),
            compression: None,
            adam: Adam { states: [("gaussians.further.age".to_owned(), state)].into() },
            density: BTreeMap::new(),
            corrections: BTreeMap::new(),
            stage: Stage::Coarse,
            iteration: 1,
            seconds: 0.0,
            rate_weight: 1.0,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(checkpoint_name(Stage::Coarse, 1));
        checkpoint.save(&path).unwrap();

        let load = |width: Option<usize>| -> Result<GaussianArrays, TrainError> {
            let loaded: Checkpoint =
                Checkpoint::load(&path, &config, &scene(&config, width), &ConfiguredModels, &device)?;
            assert!(loaded.adam.states.contains_key("gaussians.further.age"));
            Ok(loaded.scene.gaussians.to_arrays())
        };
        let loaded = load(Some(2)).unwrap();
        assert_eq!(loaded, checkpoint.scene.gaussians.to_arrays());
        assert_eq!(loaded.further[0].values, [0.0, 1.0, 0.0, 1.0]);
        let refused = |width| load(width).unwrap_err().to_string();
        assert!(refused(Some(3)).contains("`scene.gaussians.further.age` has the shape [2, 2], expected [2, 3]"));
        assert!(refused(None).contains("gaussians.further.age"), "{}", refused(None));
    }
}
