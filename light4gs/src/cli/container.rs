//! `encode`, `decode`, `info`.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_codec::attributes::AttributeInfo;
use light4gs_codec::plane_layout::PlaneShape;
use light4gs_codec::{LayerInfo, SceneData, SceneMeta, StreamInfo, read_file_with_limits, read_info_with_limits};
use light4gs_data::{Scene, write_atomically};
use light4gs_model::DeformationField;
use light4gs_model::attributes::BUILT_IN;
use light4gs_train::compression::{CodedScene, ConfiguredModels, EntropyModels, TrainedScene, code_scene};
use light4gs_train::config::{Config, DeviceName, Overrides};
use light4gs_train::dataset::{image_store, load_options};
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::section_sizes;
use light4gs_train::import::scene_around;
use light4gs_train::run::Checkpoint;
use light4gs_train::run::RunFolder;
use light4gs_train::take::{TakeFolder, backdrop_of};
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use serde_json::json;

use super::check_output;
use super::limits::LimitsArgument;
use super::output::progress::FitBar;
use super::output::{say, say_json, tell};
use super::take::{self, is_take_file};
use super::train::{coding_table, sections_table};
use super::wishes::{bytes, check_quality, decibels};

#[derive(Debug, Args)]
pub(super) struct Encode {
    /// Folder of a run.
    run: PathBuf,
    /// A checkpoint of the run; by default the newest.
    #[arg(long)]
    checkpoint: Option<PathBuf>,
    /// The file to write.
    #[arg(long)]
    out: PathBuf,
    /// Changes one key below `compression` for this file; may be given more than once. If keys of `context`, `steps` or
    /// `sh` change, the entropy models are fitted again to the finished scene. If keys of `attributes` change, the steps
    /// that were learned in training are not used.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Upper bound of the file's size in bytes, such as 300k or 2M; the size comes close to this bound. This option
    /// adapts the quantization steps of attributes.
    #[arg(long, value_name = "NUMBER", value_parser = bytes)]
    target_bytes: Option<usize>,
    /// Lower bound of the PSNR of the decoded file on the test views, dB: the smallest file that reaches the bound is
    /// written. If no file reaches the bound, the best file is written, and the exit code is 2.
    #[arg(long, value_name = "NUMBER", value_parser = decibels, conflicts_with = "target_bytes")]
    target_db: Option<f64>,
    /// Number of layers of Gaussians, the most significant Gaussians first. With several layers, such as 4, a player
    /// shows a coarse scene before the whole file has arrived.
    #[arg(long, value_name = "NUMBER")]
    layers: Option<usize>,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

impl Encode {
    pub(super) fn run(self) -> Result<(), TrainError> {
        check_output(&self.out, &self.run)?;
        if TakeFolder::is_one(&self.run) {
            let take = self.run.display();
            return Err(TrainError::Input(format!(
                "{take} is the folder of a take: give the run of a segment, such as {take}/segments/0000; `light4gs join {take}` joins \
                 the files scene.l4gs of all segments"
            )));
        }
        let (mut folder, record, config) = RunFolder::open(&self.run)?;
        if is_inside(&self.out, folder.root()) {
            folder.lock()?;
        }
        let Some(path) = self.checkpoint.or_else(|| folder.last_checkpoint()) else {
            let run = self.run.display();
            return Err(TrainError::Input(format!(
                "{run} has no checkpoint yet; train it with `light4gs resume {run}`"
            )));
        };
        let device = device::open(self.device.unwrap_or(config.device))?.autodiff();
        let checkpoint: Checkpoint =
            Checkpoint::load(&path, &config, &config.model.build(), &ConfiguredModels, &device)?;
        let data = match &record.scene {
            Some(dataset) => Scene::open(dataset, &load_options(&config))?,
            None => scene_around(&checkpoint.scene.gaussians.to_arrays(), folder.root(), config.data.background)?,
        };
        // A file follows one wish: that of the command in place of the run's.
        let (bytes, quality) = (self.target_bytes.unwrap_or(0), self.target_db.unwrap_or(0.0));
        let mut changed = config.clone();
        if bytes > 0 || quality > 0.0 {
            (changed.compression.target_bytes, changed.compression.target_db) = (bytes, quality);
        }
        changed.compression.layers = self.layers.unwrap_or(config.compression.layers);
        let changed = changed.with(&Overrides::parse(&self.overrides)?)?;
        if (Config { compression: config.compression.clone(), ..changed.clone() }) != config {
            return Err(TrainError::Input("`encode --set` changes keys below `compression` only".into()));
        }
        let (old, new) = (&config.compression, &changed.compression);
        let same_models = old.context == new.context && old.steps == new.steps && old.sh == new.sh;
        let mut compression = checkpoint.compression.clone().filter(|_| same_models);
        if let Some(models) = compression.as_mut().filter(|_| old.attributes != new.attributes) {
            models.attributes = None;
        }
        let images = image_store(&config);
        let backdrop = backdrop_of(&config, &folder, &device)?;
        let trained = TrainedScene {
            scene: &checkpoint.scene,
            compression: compression.as_ref(),
            models: &ConfiguredModels,
            config: &changed,
            data: &data,
            images: record.scene.is_some().then_some(&images),
            backdrop: backdrop.as_ref(),
            device: &device,
        };
        let coded = code_to_file(&trained, &self.out, self.json).map_err(|error| match error {
            // The checkpoint is the input here, so the error names it.
            TrainError::Codec(problem) if !problem.is_internal() => {
                TrainError::Input(format!("checkpoint {}: {problem}", path.display()))
            }
            other => other,
        })?;
        let record = coded.coding.map(|(record, _)| record);
        if let Some(record) = record.as_ref().filter(|_| !self.json) {
            let table = coding_table(record);
            if let Some(seconds) = record.fit_seconds.filter(|_| table.is_some()) {
                say(format_args!("the entropy models were fitted to the finished scene in {seconds:.1} s"))?;
            }
            if let Some(table) = table {
                say(table)?;
            }
        }
        check_quality(record.as_ref(), &self.out)
    }
}

/// Encodes a scene, with a progress bar if models are fitted, writes the file, and prints a summary.
pub(super) fn code_to_file<F: DeformationField, E: EntropyModels>(
    trained: &TrainedScene<F, E>,
    out: &Path,
    json: bool,
) -> Result<CodedScene, TrainError> {
    if trained.images.is_none() && !trained.is_seen()? {
        tell(
            "warning: the views around the scene show nothing of it, for example since all of it is transparent; so the steps \
             of the file are those of the configuration, and not measured on images",
        );
    }
    let mut bar = FitBar::new(json);
    let coded = code_scene(trained, &mut |done, iterations| {
        bar.show(done, iterations);
        Ok(())
    })?;
    write_atomically(out, |file| file.write_all(&coded.bytes))?;
    print_info(&coded.info, json)?;
    Ok(coded)
}

/// Whether an output is inside the folder of a run, into which only one process may write. The output's folder exists.
fn is_inside(out: &Path, root: &Path) -> bool {
    let absolute = |path: &Path| std::fs::canonicalize(path).ok();
    let folder = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    absolute(folder).zip(absolute(root)).is_some_and(|(folder, root)| folder.starts_with(root))
}

#[derive(Debug, Args)]
pub(super) struct Info {
    /// The .l4gs file.
    file: PathBuf,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: LimitsArgument,
}

impl Info {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if is_take_file(&self.file) {
            return take::info(&self.file, &self.limits.get(), self.json);
        }
        print_info(&read_info_with_limits(&self.file, &self.limits.get())?, self.json)
    }
}

fn print_info(info: &StreamInfo, json: bool) -> Result<(), TrainError> {
    let SceneMeta { name, frame_count, fps, bounds, background, config_digest, width, height, fov_x, .. } = &info.meta;
    let digest: String = config_digest.iter().map(|byte| format!("{byte:02x}")).collect();
    if json {
        let sections: Vec<_> = info
            .sections
            .iter()
            .map(|s| {
                json!({"name": s.name, "kind": s.kind.name(), "encoding": s.encoding.name(), "offset": s.offset, "bytes": s.bytes})
            })
            .collect();
        return say_json(&json!({
            "version": info.version, "bytes": info.bytes, "header_bytes": info.header_bytes, "sections": sections,
            "name": name, "frames": frame_count, "fps": fps, "bounds": bounds, "background": background,
            "config_digest": digest, "width": width, "height": height, "fov_x": fov_x,
            "gaussians": info.gaussian_count, "sh_degree": info.sh_degree,
            "layers": info.layers.iter().map(|layer| json!({"gaussians": layer.gaussians, "bytes_to_show": layer.bytes_to_show}))
                .collect::<Vec<_>>(),
            "bytes_to_first_image": info.bytes_to_first_image(),
            "attributes": info.attributes.iter().map(|a| json!({"name": a.name, "width": a.width, "coder": a.coder.name(),
                "optional": a.optional, "bytes": a.bytes})).collect::<Vec<_>>(),
            "feature_planes": {"channels": info.plane_channels, "planes": info.planes.planes().iter().map(|plane| {
                let [height, width] = plane.size;
                json!({"name": plane.name(), "width": width, "height": height})
            }).collect::<Vec<_>>()},
            "motion": {"kind": info.motion.kind, "layers": motion_layers(info)},
            "profile": info.profile.map(|profile| profile.name()),
            "plane_steps": info.plane_steps.iter().map(|s| [s.space_only, s.space_time]).collect::<Vec<_>>(),
            "plane_bytes": info.plane_bytes.iter().map(|p| json!({"plane": info.planes.planes()[p.plane].name(),
                "latent": p.latent, "anchors": p.anchors, "others": p.others})).collect::<Vec<_>>(),
        }));
    }
    let rate = if *fps > 0.0 { format!(" at {fps} frames per second") } else { String::new() };
    say(format_args!("{name}: version {}, {width}×{height}, {frame_count} times{rate}", info.version))?;
    say(format_args!("{} Gaussians, spherical harmonics of degree {}", info.gaussian_count, info.sh_degree))?;
    for (number, LayerInfo { gaussians, bytes_to_show }) in (1..).zip(&info.layers).filter(|_| info.layers.len() > 1) {
        let image = if number == 1 { ", the first image" } else { "" };
        say(format_args!("layer {number}: {gaussians} Gaussians, shown after {bytes_to_show} bytes{image}"))?;
    }
    let built_in = |name: &str| BUILT_IN.iter().any(|attribute| attribute.name == name);
    for AttributeInfo { name, width, coder, optional, bytes } in info.attributes.iter().filter(|a| !built_in(&a.name)) {
        let optional = if *optional { ", optional" } else { "" };
        let numbers = if *width == 1 { "number" } else { "numbers" };
        say(format_args!("their attribute {name}: {width} {numbers} each, {}, {bytes} bytes{optional}", coder.name()))?;
    }
    for scale in 0..info.planes.scales() {
        let planes = info.planes.planes()[info.planes.scale(scale)].iter().map(|plane| {
            let PlaneShape { axes, size: [height, width], .. } = plane;
            format!("{} {width}×{height}", axes.name())
        });
        let planes = planes.collect::<Vec<_>>().join(", ");
        say(format_args!("feature planes of scale {scale}: {planes}; {} channels", info.plane_channels))?;
    }
    say(match (info.motion.kind.as_str(), motion_layers(info)) {
        ("", 0) => "motion: none".to_owned(),
        ("", layers) => format!("motion: {layers} layers"),
        (kind, layers) => format!("motion: {kind}, {layers} layers"),
    })?;
    if let Some(profile) = info.profile {
        let steps: Vec<String> = info
            .plane_steps
            .iter()
            .map(|s| format!("{:.4} (space), {:.4} (time)", s.space_only, s.space_time))
            .collect();
        let steps =
            if steps.is_empty() { String::new() } else { format!("; steps of the planes: {}", steps.join("; ")) };
        say(format_args!("profile {}{steps}", profile.name()))?;
    }
    say(format_args!("configuration {digest}\n"))?;
    let sizes = section_sizes(info);
    say(sections_table(sizes.iter().map(|s| (s.name.as_str(), s.bytes)), info.bytes))
}

/// Layers of the network that moves the Gaussians.
fn motion_layers(info: &StreamInfo) -> usize {
    info.motion.network.iter().flat_map(|motion| motion.network.layers()).count()
}

#[derive(Debug, Args)]
pub(super) struct Decode {
    /// The .l4gs file.
    file: PathBuf,
    /// The safetensors file to write.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    limits: LimitsArgument,
}

impl Decode {
    pub(super) fn run(self) -> Result<(), TrainError> {
        check_output(&self.out, &self.file)?;
        if is_take_file(&self.file) {
            let file = self.file.display();
            return Err(TrainError::Input(format!(
                "{file} is a take, whose arrays differ from segment to segment: decode the file of a segment \
                 (segments/0000/scene.l4gs in the folder of the take), or write frames with `light4gs export {file} --out FOLDER`"
            )));
        }
        let data = read_file_with_limits(&self.file, &self.limits.get())?;
        let tensors = plain_tensors(&data);
        let views = tensors.iter().map(|(name, (shape, bytes))| {
            (name, TensorView::new(Dtype::F32, shape.clone(), bytes).expect("shapes match their values"))
        });
        let bytes = safetensors::serialize(views, None).map_err(|error| TrainError::Input(error.to_string()))?;
        write_atomically(&self.out, |file| file.write_all(&bytes))?;
        say(format_args!("wrote {} ({} tensors, {} bytes)", self.out.display(), tensors.len(), bytes.len()))
    }
}

/// Shapes and little-endian float32 bytes by name.
fn plain_tensors(data: &SceneData) -> BTreeMap<String, (Vec<usize>, Vec<u8>)> {
    let mut tensors = BTreeMap::new();
    let mut add = |name: String, shape: Vec<usize>, values: &[f32]| {
        tensors.insert(name, (shape, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    };
    let gaussians = &data.gaussians;
    let count = gaussians.len();
    for attribute in gaussians.attributes() {
        let shape = match attribute.name {
            "sh_dc" | "sh_rest" => vec![count, attribute.width / 3, 3],
            _ => vec![count, attribute.width],
        };
        add(format!("gaussians.{}", attribute.name), shape, attribute.values);
    }
    add("coordinates.mean".into(), vec![3], &data.coordinates.mean);
    add("coordinates.axes".into(), vec![3, 3], data.coordinates.axes.as_flattened());
    add("coordinates.std".into(), vec![3], &data.coordinates.std);
    for plane in &data.feature_planes.planes {
        let shape = vec![data.feature_planes.channels as usize, plane.height as usize, plane.width as usize];
        add(format!("feature_planes.{}", plane.shape().name()), shape, &plane.values);
    }
    let layers = data.motion.network.iter().flat_map(|motion| motion.network.layers());
    for (i, layer) in layers.enumerate() {
        add(format!("motion.{i}.weight"), vec![layer.outputs as usize, layer.inputs as usize], &layer.weight);
        add(format!("motion.{i}.bias"), vec![layer.outputs as usize], &layer.bias);
    }
    for tensor in &data.motion.tensors {
        add(
            format!("motion.{}", tensor.name),
            tensor.shape.iter().map(|side| *side as usize).collect(),
            &tensor.values,
        );
    }
    tensors
}
