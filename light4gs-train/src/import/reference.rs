//! Checkpoints of 4DGaussians (Wu et al. 2024), and of the public code of Light4GS, which descends from it.
//!
//! `point_cloud.ply` has the Gaussians, `deformation.pth` the planes and the network. The two programs map points to
//! planes differently; checkpoints of Light4GS are recognized by their principal axes:
//! - 4DGaussians maps a box linearly to [-1, 1], its far corner to -1, and uses the times 0 to 1 as plane coordinates,
//!   so that half of the planes' rows are never read; those are left out here;
//! - Light4GS standardizes along principal axes, maps a box to [-1, 1], contracts, and ends in [0, 1].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use burn::module::{Module, Param};
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout, PlaneShape, TIME_AXIS};
use light4gs_codec::{CoordinateMapping, GaussianArrays};
use light4gs_data::{DataError, PlainTensor, read_pytorch};
use light4gs_model::{
    Deformation, DeformationHead, DynamicScene, FeaturePlanes, Gaussians, HexPlaneField, Pca, PlaneTensors,
    SceneCoordinates,
};

use super::ImportedScene;
use super::bounds::make_finite;
use super::settings::Settings;
use super::still::read_gaussians;
use crate::error::TrainError;

const REMEDY: &str = "name a folder that 4DGaussians has saved, such as output/NAME/point_cloud/iteration_14000";
/// Time is padded to a multiple of this, which the context model needs.
const TIME_MULTIPLE: usize = 4;

/// Reads a checkpoint: the folder of an iteration, or the folder of the whole model, of which the last iteration is
/// taken.
///
/// # Errors
/// [`TrainError::Data`] with the file that is missing or damaged, or with the tensor that shows another structure of the
/// network.
pub fn read(folder: &Path, device: &Device) -> Result<ImportedScene, TrainError> {
    let folder = iteration_folder(folder)?;
    let settings = match find_settings(&folder) {
        Some(path) => Settings::read(&path)?,
        None => Settings::default(),
    };
    let (mut gaussians, _) = read_gaussians(&folder.join("point_cloud.ply"))?;
    make_finite(&mut gaussians);
    check_table(&folder, &gaussians)?;
    let path = folder.join("deformation.pth");
    let mut weights = Weights { tensors: read_pytorch(&path)?, path, device };
    let scene = scene(&mut weights, &gaussians, &settings)?;
    let background = if settings.white_background { [1.0; 3] } else { [0.0; 3] };
    Ok(ImportedScene { scene, background, source: folder })
}

/// The folder with the files: the given one, or one below it.
fn iteration_folder(folder: &Path) -> Result<PathBuf, DataError> {
    let has_files = |folder: &Path| folder.join("deformation.pth").exists() || folder.join("point_cloud.ply").exists();
    if has_files(folder) {
        return Ok(folder.to_owned());
    }
    let below = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.filter_map(|entry| {
            let iteration = entry.file_name().to_str()?.strip_prefix("iteration_")?.parse::<u64>().ok()?;
            Some((iteration, entry.path()))
        })
    };
    let found = below(folder).chain(below(&folder.join("point_cloud"))).filter(|(_, path)| has_files(path)).max();
    found.map(|(_, path)| path).ok_or_else(|| {
        let problem = "no deformation.pth there, nor in an iteration_N or point_cloud/iteration_N below it";
        DataError::field(folder, "checkpoint", problem, REMEDY)
    })
}

fn find_settings(folder: &Path) -> Option<PathBuf> {
    let folder = std::fs::canonicalize(folder).ok()?;
    folder.ancestors().take(3).map(|folder| folder.join("cfg_args")).find(|path| path.is_file())
}

/// The table lists the Gaussians that an earlier version moved. The current version moves all of them, and so does the
/// import. It must be the table of these Gaussians.
fn check_table(folder: &Path, gaussians: &GaussianArrays) -> Result<(), DataError> {
    let path = folder.join("deformation_table.pth");
    if !path.exists() {
        return Ok(());
    }
    let found: usize = read_pytorch(&path)?.values().map(|table| table.values.len()).sum();
    if found != gaussians.len() {
        let problem = format!("{found} entries, but point_cloud.ply has {} Gaussians", gaussians.len());
        return Err(DataError::field(&path, "table", problem, "name a folder whose files are of one iteration"));
    }
    Ok(())
}

/// Tensors of `deformation.pth`.
struct Weights<'a> {
    path: PathBuf,
    tensors: BTreeMap<String, PlainTensor>,
    device: &'a Device,
}

impl Weights<'_> {
    fn wrong(&self, name: &str, problem: impl Into<String>) -> TrainError {
        DataError::field(&self.path, name, problem, REMEDY).into()
    }

    fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// A tensor of finite values.
    fn take(&mut self, name: &str) -> Result<PlainTensor, TrainError> {
        let Some(tensor) = self.tensors.remove(name) else { return Err(self.wrong(name, "the tensor is missing")) };
        if tensor.values.iter().any(|value| !value.is_finite()) {
            return Err(self.wrong(name, "it holds NaN or infinity"));
        }
        Ok(tensor)
    }

    /// A tensor of a known shape.
    fn take_shaped(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, TrainError> {
        let tensor = self.take(name)?;
        if tensor.shape != shape {
            return Err(self.wrong(name, format!("shape {:?}, expected {shape:?}", tensor.shape)));
        }
        Ok(tensor.values)
    }

    fn vector(&mut self, name: &str) -> Result<[f32; 3], TrainError> {
        let values = self.take_shaped(name, &[3])?;
        Ok([values[0], values[1], values[2]])
    }

    /// A layer with `inputs` inputs, and with `outputs` outputs if that is known.
    fn linear(&mut self, name: &str, inputs: usize, outputs: Option<usize>) -> Result<Linear, TrainError> {
        let key = format!("{name}.weight");
        let PlainTensor { shape, values } = self.take(&key)?;
        let [rows, columns] = shape[..] else { return Err(self.wrong(&key, format!("shape {shape:?} is no matrix"))) };
        if columns != inputs || rows == 0 || outputs.is_some_and(|outputs| outputs != rows) {
            let expected = outputs.map_or("any number".to_owned(), |outputs| outputs.to_string());
            return Err(self.wrong(&key, format!("shape {shape:?}, expected [{expected}, {inputs}]")));
        }
        let bias = self.take_shaped(&format!("{name}.bias"), &[rows])?;
        // PyTorch has weights as `[outputs, inputs]`, Burn the transpose.
        let transposed = (0..rows * columns).map(|k| values[k % rows * columns + k / rows]).collect::<Vec<_>>();
        Ok(Linear {
            weight: Param::from_tensor(Tensor::from_data(TensorData::new(transposed, [columns, rows]), self.device)),
            bias: Some(Param::from_tensor(Tensor::from_data(TensorData::new(bias, [rows]), self.device))),
        })
    }
}

fn scene(
    weights: &mut Weights,
    gaussians: &GaussianArrays,
    settings: &Settings,
) -> Result<DynamicScene<HexPlaneField>, TrainError> {
    for part in ["static_mlp.1.weight", "empty_voxel.grid"] {
        if weights.has(&format!("deformation_net.{part}")) {
            return Err(weights.wrong(part, "a part that 4DGaussians calls useless, and that is not supported"));
        }
    }
    if settings.apply_rotation {
        return Err(weights.wrong("apply_rotation", "cfg_args says True; quaternion products are not supported"));
    }
    let (mut planes, channels) = planes(weights)?;
    let (pca, mut mapping) = coordinates(weights)?;
    crop_and_pad_times(&mut planes, &mut mapping);
    let layout = PlaneLayout::new(planes.iter().map(|plane| plane.shape).collect());
    let layout = layout.expect("planes are read in the order of a layout");
    let tensors =
        planes.into_iter().map(|StoredPlane { shape: PlaneShape { size: [height, width], .. }, values, .. }| {
            Tensor::from_data(TensorData::new(values, [channels, height, width]), weights.device)
        });
    let hexplane = FeaturePlanes::from_tensors(PlaneTensors::new(layout, tensors.collect()));
    let deformation = deformation(weights, hexplane.feature_size(), settings)?;
    let device = weights.device;
    Ok(DynamicScene {
        gaussians: Gaussians::from_arrays(gaussians, device),
        coordinates: SceneCoordinates::new(&pca, device).with_mapping(mapping),
        field: HexPlaneField { hexplane, deformation },
        differentiate_points: false,
    }
    .no_grad())
}

/// A plane of a checkpoint, `[C, H, W]`.
struct StoredPlane {
    shape: PlaneShape,
    channels: usize,
    values: Vec<f32>,
}

/// The planes of all scales, which must be a hexplane, and their channels.
fn planes(weights: &mut Weights) -> Result<(Vec<StoredPlane>, usize), TrainError> {
    let name = |scale: usize, plane: usize| format!("deformation_net.grid.grids.{scale}.{plane}");
    let mut planes: Vec<StoredPlane> = Vec::new();
    let mut base: Option<[usize; 5]> = None;
    for scale in 0.. {
        if scale > 0 && !weights.has(&name(scale, 0)) {
            break;
        }
        let mut sides = [None; 4];
        for axes in PlaneAxes::ALL {
            let key = name(scale, axes as usize);
            let tensor = weights.take(&key)?;
            let [1, channels, height, width] = tensor.shape[..] else {
                return Err(weights.wrong(&key, format!("shape {:?}, expected [1, C, H, W]", tensor.shape)));
            };
            let known = *base.get_or_insert([channels, 0, 0, 0, 0]);
            let [across, down] = axes.axes();
            let agree = [(across, width), (down, height)]
                .into_iter()
                .all(|(axis, side)| side > 1 && *sides[axis].get_or_insert(side) == side);
            if !agree || channels != known[0] || channels == 0 {
                let problem = format!("shape {:?} does not fit the planes before it", tensor.shape);
                return Err(weights.wrong(&key, problem));
            }
            let shape = PlaneShape { scale, axes, size: [height, width] };
            planes.push(StoredPlane { shape, channels, values: tensor.values });
        }
        let sides = sides.map(|side| side.unwrap_or(0));
        let base = base.get_or_insert([0; 5]);
        if scale == 0 {
            base[1..].copy_from_slice(&sides);
        }
        // One multiplier for the three axes of space; time keeps its resolution.
        let multiplier = sides[0] / base[1].max(1);
        let fits = (0..4).all(|axis| sides[axis] == base[axis + 1] * if axis == TIME_AXIS { 1 } else { multiplier });
        if !fits {
            let problem = format!("resolutions {sides:?} are no multiple of the first scale's {:?}", &base[1..]);
            return Err(weights.wrong(&name(scale, 0), problem));
        }
    }
    let channels = base.map_or(0, |base| base[0]);
    Ok((planes, channels))
}

/// The mapping of points and times to the planes.
fn coordinates(weights: &mut Weights) -> Result<(Pca, CoordinateMapping), TrainError> {
    const AABB: &str = "deformation_net.grid.aabb";
    let aabb = weights.take_shaped(AABB, &[2, 3])?;
    // The far corner comes first.
    let center: [f32; 3] = std::array::from_fn(|axis| (aabb[axis] + aabb[3 + axis]) / 2.0);
    let half: [f32; 3] = std::array::from_fn(|axis| (aabb[axis] - aabb[3 + axis]) / 2.0);
    if half.contains(&0.0) {
        return Err(weights.wrong(AABB, format!("{aabb:?} is an empty box")));
    }
    if !weights.has("deformation_net.grid.rotation_matrix") {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mapping = CoordinateMapping {
            contracts: false,
            scale: [-1.0; 3],
            offset: [0.0; 3],
            time_scale: 0.5,
            time_offset: 0.5,
        };
        return Ok((Pca { mean: center, axes, std: half }, mapping));
    }
    let rotation = weights.take_shaped("deformation_net.grid.rotation_matrix", &[3, 3])?;
    let mean = weights.vector("deformation_net.grid.pca_mean")?;
    let deviations = weights.vector("deformation_net.grid.variance")?;
    let axes: [[f32; 3]; 3] = std::array::from_fn(|axis| std::array::from_fn(|row| rotation[3 * row + axis]));
    let product = |a: usize, b: usize| (0..3).map(|k| axes[a][k] * axes[b][k]).sum::<f32>();
    let orthonormal = (0..3).all(|a| (0..3).all(|b| (product(a, b) - f32::from(u8::from(a == b))).abs() < 1e-3));
    if !orthonormal || deviations.iter().any(|deviation| *deviation <= 0.0) {
        let problem = format!("{rotation:?} with deviations {deviations:?} are no principal axes");
        return Err(weights.wrong("deformation_net.grid.rotation_matrix", problem));
    }
    // The box is given in standardized coordinates: it shifts the mean and scales the deviations.
    let moved = std::array::from_fn(|k| {
        mean[k] + (0..3).map(|axis| center[axis] * deviations[axis] * axes[axis][k]).sum::<f32>()
    });
    let std = std::array::from_fn(|axis| deviations[axis] * half[axis]);
    let mapping =
        CoordinateMapping { contracts: true, scale: [0.25; 3], offset: [0.5; 3], ..CoordinateMapping::default() };
    Ok((Pca { mean: moved, axes, std }, mapping))
}

/// Removes rows of the space-time planes before the first time, and repeats the last row up to a multiple of 4. The
/// mapping of time is changed so that queries give the same values.
fn crop_and_pad_times(planes: &mut [StoredPlane], mapping: &mut CoordinateMapping) {
    let Some(times) = planes.iter().find_map(|plane| plane.shape.cells_along(TIME_AXIS)) else { return };
    let last = (times - 1) as f32;
    let (slope, first) = (mapping.time_scale * last, mapping.time_offset * last);
    let skipped = (first.max(0.0) as usize).min(times - 2);
    let padded = (times - skipped).next_multiple_of(TIME_MULTIPLE);
    mapping.time_scale = slope / (padded - 1) as f32;
    mapping.time_offset = (first - skipped as f32) / (padded - 1) as f32;
    for plane in planes.iter_mut().filter(|plane| plane.shape.axes.is_space_time()) {
        let [_, width] = plane.shape.size;
        let row = |channel: usize, row: usize| {
            let begin = (channel * times + (row + skipped).min(times - 1)) * width;
            &plane.values[begin..begin + width]
        };
        let values = (0..plane.channels).flat_map(|channel| (0..padded).flat_map(move |k| row(channel, k).to_vec()));
        plane.values = values.collect();
        plane.shape.size = [padded, width];
    }
}

fn deformation(weights: &mut Weights, features: usize, settings: &Settings) -> Result<Deformation, TrainError> {
    let layer = |index: usize| format!("deformation_net.feature_out.{}", 2 * index);
    let mut trunk = vec![weights.linear(&layer(0), features, None)?];
    let [_, width] = trunk[0].weight.dims();
    while weights.has(&format!("{}.weight", layer(trunk.len()))) {
        trunk.push(weights.linear(&layer(trunk.len()), width, Some(width))?);
    }
    let mut head = |unused: bool, name: &str, outputs: usize| {
        if unused {
            return Ok(None);
        }
        let layer = |index: usize| format!("deformation_net.{name}.{index}");
        Ok::<_, TrainError>(Some(DeformationHead {
            hidden: weights.linear(&layer(1), width, Some(width))?,
            output: weights.linear(&layer(3), width, Some(outputs))?,
        }))
    };
    Ok(Deformation {
        position: head(settings.no_dx, "pos_deform", 3)?,
        scale: head(settings.no_ds, "scales_deform", 3)?,
        rotation: head(settings.no_dr, "rotations_deform", 4)?,
        opacity: head(settings.no_do, "opacity_deform", 1)?,
        sh: head(settings.no_dshs, "shs_deform", 48)?,
        trunk,
    })
}
