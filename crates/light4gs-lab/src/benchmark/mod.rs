//! Timing of every part of a training step, on scenes that anybody can make.

pub mod codec;
pub mod host;
mod launches;
mod steps;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use burn::tensor::{Device, Distribution, Tensor, TensorData};
use glam::{Mat3, Quat, Vec3};
use light4gs_data::{Camera, DataError, read_regular_file};
use light4gs_model::ops::skinning::{Moved, SkinningInputs, skin};
use light4gs_model::{DeformationConfig, GaussianTensors, Gaussians, HexPlaneConfig, ReadBacks, Splatter};
use light4gs_train::config::DeviceName;
use light4gs_train::device::adapter_name;
use light4gs_train::error::TrainError;
use light4gs_train::table::{Align, Table};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use safetensors::{Dtype, SafeTensors};
use serde_json::json;

use self::launches::Launches;
use self::steps::FIELDS;
use crate::record::Row;

/// The part that is timed once a device.
const CALIBRATION_PART: &str = "1024×1024 matmul";
/// Untimed repetitions before the timed ones.
const WARM_UP: usize = 2;
/// Nodes that the Gaussians follow in the rows on skinning.
const SKINNING_NODES: usize = 32;
/// Side of the calibration product's matrices.
const CALIBRATION: usize = 1024;

/// Gaussians and a camera to time with.
#[derive(Clone, Debug)]
pub struct BenchScene {
    /// Name in the table.
    pub name: String,
    camera: Camera,
    background: [f32; 3],
    means: Vec<f32>,
    log_scales: Vec<f32>,
    quats: Vec<f32>,
    opacity_logits: Vec<f32>,
    /// `[N, 16, 3]`
    sh: Vec<f32>,
}

impl BenchScene {
    /// A seeded cloud of `count` Gaussians in the unit ball before a camera with a square image.
    pub fn generate(count: usize, size: u32) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(count as u64);
        let mut symmetric = |half: f32| rng.random_range(-half..half);
        let mut scene = Self {
            name: format!("{}k @ {size}²", count as f32 / 1000.0),
            camera: Camera::look_at(Vec3::new(0.0, -4.0, 0.5), Vec3::ZERO, Vec3::Z, 0.69, size, size),
            background: [1.0; 3],
            means: Vec::new(),
            log_scales: Vec::new(),
            quats: Vec::new(),
            opacity_logits: Vec::new(),
            sh: Vec::new(),
        };
        // The total projected area does not change with the count, as in trained scenes.
        let typical = -3.0 - 0.5 * (count as f32 / 5000.0).ln();
        for _ in 0..count {
            scene.means.extend((0..3).map(|_| symmetric(1.2)));
            scene.log_scales.extend((0..3).map(|_| typical + symmetric(0.7)));
            scene.quats.extend((0..4).map(|k| symmetric(1.0) + if k == 0 { 1.5 } else { 0.0 }));
            scene.opacity_logits.push(symmetric(3.0));
            scene.sh.extend((0..48).map(|k| symmetric(if k < 3 { 1.5 } else { 0.2 })));
        }
        scene
    }

    /// Reads a scene file: `means`, `log_scales`, `quats_wxyz`, `raw_opacities`, `sh_coeffs`, `background`,
    /// `image_wh`, `K`, `viewmat` (see `docs/benchmarks.md`).
    ///
    /// # Errors
    /// [`TrainError::Data`] for a file that cannot be read, or with the tensor that is missing or has another type or shape.
    pub fn open(path: &Path) -> Result<Self, TrainError> {
        let bytes = read_regular_file(path, u64::MAX).map_err(DataError::io("read", path))?;
        let field = |field: &str, problem: String| DataError::Field {
            path: path.to_owned(),
            field: field.to_owned(),
            problem,
            remedy: "see docs/benchmarks.md for the layout".into(),
        };
        let file = SafeTensors::deserialize(&bytes).map_err(|error| field("header", error.to_string()))?;
        let values = |name: &str, expected: Option<usize>| -> Result<Vec<f32>, DataError> {
            let view = file.tensor(name).map_err(|error| field(name, error.to_string()))?;
            let data = view.data();
            let values: Vec<f32> = match view.dtype() {
                Dtype::F32 => data.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect(),
                Dtype::I32 => data.as_chunks().0.iter().map(|b| i32::from_le_bytes(*b) as f32).collect(),
                Dtype::I64 => data.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b) as f32).collect(),
                other => return Err(field(name, format!("type {other:?}, expected float32 or integers"))),
            };
            match expected {
                Some(expected) if expected != values.len() => {
                    Err(field(name, format!("{} values, expected {expected}", values.len())))
                }
                _ => Ok(values),
            }
        };
        let opacity_logits = values("raw_opacities", None)?;
        let count = opacity_logits.len();
        if count == 0 {
            return Err(field("raw_opacities", "no Gaussians, expected at least one".into()).into());
        }
        let size = values("image_wh", Some(2))?;
        if !size.iter().all(|side| (1.0..=16_384.0).contains(side)) {
            return Err(field("image_wh", format!("{size:?}, expected sides between 1 and 16384")).into());
        }
        let k = values("K", Some(9))?;
        let m = values("viewmat", Some(16))?;
        let background = values("background", Some(3))?;
        Ok(Self {
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            camera: Camera {
                rotation: Mat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]),
                translation: Vec3::new(m[3], m[7], m[11]),
                fx: k[0],
                fy: k[4],
                cx: k[2],
                cy: k[5],
                width: size[0] as u32,
                height: size[1] as u32,
            },
            background: [background[0], background[1], background[2]],
            means: values("means", Some(3 * count))?,
            log_scales: values("log_scales", Some(3 * count))?,
            quats: values("quats_wxyz", Some(4 * count))?,
            sh: values("sh_coeffs", Some(48 * count))?,
            opacity_logits,
        })
    }

    fn count(&self) -> usize {
        self.opacity_logits.len()
    }

    /// The Gaussians on a device.
    fn gaussians(&self, device: &Device) -> Gaussians {
        let count = self.count();
        let matrix = |values: &[f32], columns: usize| {
            Tensor::<2>::from_data(TensorData::new(values.to_vec(), [count, columns]), device)
        };
        let sh = |range: std::ops::Range<usize>| {
            let values: Vec<f32> = self.sh.chunks_exact(48).flat_map(|row| row[range.clone()].to_vec()).collect();
            Tensor::<3>::from_data(TensorData::new(values, [count, range.len() / 3, 3]), device)
        };
        Gaussians::from_tensors(GaussianTensors {
            means: matrix(&self.means, 3),
            log_scales: matrix(&self.log_scales, 3),
            quats: matrix(&self.quats, 4),
            opacity_logits: matrix(&self.opacity_logits, 1),
            sh_dc: sh(0..3),
            sh_rest: sh(3..48),
            further: Vec::new(),
        })
    }

    /// The camera turned a little about the vertical, so that frames of a series differ.
    fn camera_at(&self, frame: usize) -> Camera {
        let turn = Mat3::from_quat(Quat::from_rotation_z(0.02 * frame as f32));
        Camera { rotation: self.camera.rotation * turn, ..self.camera }
    }
}

/// One part.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Its name.
    pub name: String,
    /// Its cost.
    pub cost: Cost,
}

/// The cost of a part.
#[derive(Clone, Debug)]
pub struct Cost {
    /// Median over the repetitions.
    pub milliseconds: f64,
    /// Kernel launches of one repetition, by the kernel's name; empty on devices that launch none.
    pub launches: BTreeMap<String, u64>,
    /// Times that the host read from the device in one repetition: it waits for each.
    pub read_backs: u64,
    /// Bytes that it read.
    pub read_bytes: u64,
}

/// All parts on one scene.
#[derive(Clone, Debug)]
pub struct SceneTimes {
    /// Name of the scene.
    pub scene: String,
    /// In the order of a training step.
    pub timings: Vec<Timing>,
}

/// All scenes on one device.
#[derive(Clone, Debug)]
pub struct DeviceTimes {
    /// Name of the back end.
    pub device: String,
    /// The name that its graphics adapter reports, if it has one.
    pub adapter: Option<String>,
    /// Median time of a 1024×1024 float32 product, for comparing machines.
    pub calibration_ms: f64,
    /// One entry a scene.
    pub scenes: Vec<SceneTimes>,
}

/// Measures parts on a device.
struct Meter<'a> {
    device: &'a Device,
    repeats: usize,
    launches: &'a Launches,
}

impl Meter<'_> {
    /// The cost of `run`; `prepare` does not count.
    fn measure<T, R>(&self, mut prepare: impl FnMut() -> T, mut run: impl FnMut(T) -> R) -> Cost {
        let mut times = Vec::with_capacity(self.repeats);
        let (mut launches, mut read_backs) = (BTreeMap::new(), ReadBacks::default());
        for repetition in 0..WARM_UP + self.repeats {
            let input = prepare();
            // A device that cannot wait has nothing to wait for.
            let _ = self.device.sync();
            self.launches.take();
            let read = ReadBacks::so_far();
            let begin = Instant::now();
            let output = run(input);
            let _ = self.device.sync();
            if repetition >= WARM_UP {
                times.push(begin.elapsed().as_secs_f64() * 1e3);
            }
            (launches, read_backs) = (self.launches.take(), read.until_now());
            drop(output);
        }
        let ReadBacks { count, bytes } = read_backs;
        Cost { milliseconds: median_of(times), launches, read_backs: count, read_bytes: bytes }
    }
}

fn median_of(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// `count` Gaussians and `nodes` nodes in a box `[-1, 1]³`, with gradients on an autodiff device. The radius of a node is 0.6
/// of the side of a cube that has the node's share of the box.
fn skinning_inputs(count: usize, nodes: usize, device: &Device) -> SkinningInputs {
    let leaf = |tensor: Tensor<2>| if device.is_autodiff() { tensor.require_grad() } else { tensor };
    let random =
        |rows: usize, columns: usize| Tensor::<2>::random([rows, columns], Distribution::Uniform(-1.0, 1.0), device);
    let radius = 0.6 * 2.0 / (nodes as f32).cbrt();
    let precisions = Tensor::full([nodes, 1], 0.5 / (radius * radius), device);
    SkinningInputs::new(
        leaf(random(count, 3)),
        leaf(random(count, 4)),
        leaf(random(count, 1)),
        leaf(Tensor::cat(vec![random(nodes, 3), precisions, random(nodes, 16)], 1)),
    )
}

/// Times every part on every scene, `repeats` times each, on a device without autodiff.
///
/// # Errors
/// [`TrainError`] if a trainer for a scene cannot be made, or a step of it fails.
pub fn benchmark(
    name: DeviceName,
    device: &Device,
    scenes: &[BenchScene],
    repeats: usize,
) -> Result<DeviceTimes, TrainError> {
    let autodiff = device.clone().autodiff();
    let matrix = || Tensor::<2>::random([CALIBRATION, CALIBRATION], Distribution::Default, device);
    let (a, b) = (matrix(), matrix());
    let launches = &Launches::on(name);
    let meter = &Meter { device, repeats, launches };
    let calibration = meter.measure(|| (a.clone(), b.clone()), |(a, b)| a.matmul(b));
    let of_scene = |scene: &BenchScene| {
        let timings = timings(scene, meter, &autodiff)?;
        Ok(SceneTimes { scene: scene.name.clone(), timings })
    };
    let scenes = scenes.iter().map(of_scene).collect::<Result<_, TrainError>>()?;
    Ok(DeviceTimes {
        device: name.to_string(),
        adapter: adapter_name(name, device),
        calibration_ms: calibration.milliseconds,
        scenes,
    })
}

fn timings(scene: &BenchScene, meter: &Meter, autodiff: &Device) -> Result<Vec<Timing>, TrainError> {
    let mut out = Vec::new();
    let mut add = |name: &str, cost: Cost| out.push(Timing { name: name.to_owned(), cost });
    let device = meter.device;
    let splatter = Splatter::new(scene.background, 3);
    let [height, width] = [scene.camera.height as usize, scene.camera.width as usize];

    let still = scene.gaussians(device);
    add(
        "project",
        meter.measure(
            || still.tensors(),
            |g| {
                // An image of one pixel, so that almost nothing but blending is left out.
                let camera = Camera { width: 1, height: 1, ..scene.camera };
                splatter.render(g, &camera, None)
            },
        ),
    );
    let forward = meter.measure(|| still.tensors(), |g| splatter.render(g, &scene.camera, None).image);
    add("splat forward", forward);

    let trained = scene.gaussians(autodiff);
    let weights = Tensor::<3>::random([height, width, 3], Distribution::Default, autodiff);
    let weighted = |g: GaussianTensors| (splatter.render(g, &scene.camera, None).image * weights.clone()).sum();
    add("splat backward", meter.measure(|| weighted(trained.tensors()), |loss| loss.backward()));
    add("splat forward + backward", meter.measure(|| trained.tensors(), |g| weighted(g).backward()));

    let count = scene.count();
    let planes = HexPlaneConfig { resolution: [64, 64, 64, 24], ..Default::default() }.init(autodiff);
    let points = Tensor::<2>::random([count, 4], Distribution::Uniform(-1.0, 1.0), autodiff).require_grad();
    let upstream = Tensor::<2>::random([count, planes.feature_size()], Distribution::Default, autodiff);
    add("hexplane forward", meter.measure(|| points.clone(), |points| planes.query(points)));
    let query = |points: Tensor<2>| (planes.query(points) * upstream.clone()).sum();
    add("hexplane backward", meter.measure(|| query(points.clone()), |loss| loss.backward()));
    let both = meter.measure(|| points.clone(), |points| query(points).backward());
    add("hexplane forward + backward", both);

    let inputs = skinning_inputs(count, SKINNING_NODES, autodiff);
    let [of_means, of_quats] = [3, 4].map(|k| Tensor::<2>::random([count, k], Distribution::Default, autodiff));
    add("skinning forward", meter.measure(|| inputs.clone(), skin));
    let skinned = |inputs: SkinningInputs| {
        let Moved { means, quats } = skin(inputs);
        (means * of_means.clone()).sum() + (quats * of_quats.clone()).sum()
    };
    add("skinning backward", meter.measure(|| skinned(inputs.clone()), |loss| loss.backward()));
    let both = meter.measure(|| inputs.clone(), |inputs| skinned(inputs).backward());
    add("skinning forward + backward", both);

    let network = DeformationConfig::default().init(64, autodiff);
    let features = Tensor::<2>::random([count, 64], Distribution::Default, autodiff).require_grad();
    let deform = |features: Tensor<2>| {
        let deltas = network.forward(features);
        let parts = [deltas.position, deltas.scale, deltas.rotation];
        parts.into_iter().flatten().map(|t| t.sum()).reduce(|a, b| a + b).expect("three heads")
    };
    add("deformation forward", meter.measure(|| features.clone(), &deform));
    add("deformation backward", meter.measure(|| deform(features.clone()), |loss| loss.backward()));

    for field in &FIELDS {
        field.timings(scene, meter, &mut |name, cost| out.push(Timing { name, cost }))?;
    }
    Ok(out)
}

/// A row for each device, scene and part; the calibration product has no scene.
pub fn rows(results: &[DeviceTimes]) -> Vec<Row> {
    let of_device = |times: &DeviceTimes| {
        let (device, adapter) = (&times.device, &times.adapter);
        let calibration = json!({
            "device": device, "adapter": adapter, "part": CALIBRATION_PART, "milliseconds": times.calibration_ms,
        });
        let of_scene = |scene: &SceneTimes| timing_rows(device, adapter.as_deref(), Some(&scene.scene), &scene.timings);
        let mut rows: Vec<Row> = times.scenes.iter().flat_map(of_scene).collect();
        rows.extend(calibration.as_object().cloned());
        rows
    };
    results.iter().flat_map(of_device).collect()
}

/// A row for each part on one device.
fn timing_rows(device: &str, adapter: Option<&str>, scene: Option<&str>, timings: &[Timing]) -> Vec<Row> {
    let of_part = |Timing { name, cost }: &Timing| {
        let row = json!({
            "device": device,
            "adapter": adapter,
            "scene": scene,
            "part": name,
            "milliseconds": cost.milliseconds,
            "launches": cost.launches.values().sum::<u64>(),
            "kernels": cost.launches,
            "read_backs": cost.read_backs,
            "read_bytes": cost.read_bytes,
        });
        row.as_object().cloned()
    };
    timings.iter().filter_map(of_part).collect()
}

/// One table: a row for each part, a column for each device and scene.
pub fn table(results: &[DeviceTimes]) -> String {
    let mut columns = vec![("ms (median)".to_owned(), Align::Left)];
    for device in results {
        columns.extend(device.scenes.iter().map(|s| (format!("{} {}", device.device, s.scene), Align::Right)));
    }
    let mut table = Table::new(columns);
    let Some(first) = results.first().and_then(|device| device.scenes.first()) else { return String::new() };
    let cells = |row: &str, value: &dyn Fn(&DeviceTimes, &SceneTimes) -> f64| {
        let times = results.iter().flat_map(|device| device.scenes.iter().map(move |scene| (device, scene)));
        std::iter::once(row.to_owned())
            .chain(times.map(|(device, scene)| format!("{:.2}", value(device, scene))))
            .collect::<Vec<_>>()
    };
    for (i, timing) in first.timings.iter().enumerate() {
        table.row(cells(&timing.name, &|_, scene| scene.timings[i].cost.milliseconds));
    }
    let timing_of = |name: String| {
        move |_: &DeviceTimes, scene: &SceneTimes| {
            let timing = scene.timings.iter().find(|timing| timing.name == name);
            1e3 / timing.map_or(f64::NAN, |timing| timing.cost.milliseconds)
        }
    };
    for field in &FIELDS {
        table.row(cells(&field.row("training it/s"), &timing_of(field.row("training step"))));
        table.row(cells(&field.row("render FPS"), &timing_of(field.row("render"))));
    }
    table.rule().row(cells(CALIBRATION_PART, &|device, _| device.calibration_ms));
    let launches = launch_table(results).unwrap_or_default();
    let adapters = results.iter().filter_map(|device| Some((&device.device, device.adapter.as_ref()?)));
    adapters.fold(table.to_string() + &launches, |text, (device, adapter)| format!("{text}\n{device}: {adapter}"))
}

/// The launches of each part on devices that have any. They hardly depend on the scene (passes of a sort, planes in the
/// rate), so those of the first one are shown.
fn launch_table(results: &[DeviceTimes]) -> Option<String> {
    let launching: Vec<(&str, &SceneTimes)> = results
        .iter()
        .filter_map(|device| Some((device.device.as_str(), device.scenes.first()?)))
        .filter(|(_, scene)| scene.timings.iter().any(|timing| !timing.cost.launches.is_empty()))
        .collect();
    let (_, first) = launching.first()?;
    let columns = launching.iter().map(|(device, scene)| (format!("{device} {}", scene.scene), Align::Right));
    let mut table = Table::new(std::iter::once(("kernel launches".to_owned(), Align::Left)).chain(columns));
    for (i, timing) in first.timings.iter().enumerate() {
        let sums = launching.iter().map(|(_, scene)| scene.timings[i].cost.launches.values().sum::<u64>().to_string());
        table.row(std::iter::once(timing.name.clone()).chain(sums));
    }
    Some(format!("\n{table}"))
}
