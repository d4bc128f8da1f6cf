//! `export`.

mod skin;

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_codec::{GaussianArrays, SceneMeta, StreamInfo, read_stream};
use light4gs_data::{
    GaussianPly, GlbOptions, MotionSample, NumberedFiles, write_atomically, write_four_dgs, write_glb, write_ply_zip,
};
use light4gs_model::{BuiltInField, STILLNESS};
use light4gs_train::config::DeviceName;
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::DecodedScene;
use light4gs_web::page::{Content, page};

use self::skin::{Distances, NodesMotion};
use super::check_output;
use super::limits::LimitsArgument;
use super::limits::most::{MOST_FRAMES, frame_count};
use super::output::say;
use super::view::dataset_cameras;

/// Most cameras of each split in a page: enough to choose from, few enough to send.
const MOST_CAMERAS: usize = 60;
/// Frames a second, so that times of frames are different numbers.
const FPS: RangeInclusive<f64> = 1e-3..=1e5;

#[derive(Debug, Args)]
pub(super) struct Export {
    /// The .l4gs file.
    file: PathBuf,
    /// Folder or file. Folder (no suffix, a slash at the end, or an existing folder): `0000.ply`, `0001.ply`, ...; it must
    /// not hold numbered PLY files of another sequence. .zip: the same PLY files. .ply, .glb (KHR_gaussian_splatting): a
    /// single time. .4dgs: the whole motion. A .glb of control nodes has the whole motion too (skin and animation), unless
    /// --time asks for a single time.
    #[arg(long, required_unless_present = "html")]
    out: Option<PathBuf>,
    /// One file that plays the scene in a browser without any other file.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "frames", "device", "time", "fps", "z_up", "limits"])]
    html: Option<PathBuf>,
    /// Dataset whose cameras the page offers; by default that of the run whose folder holds the file.
    #[arg(long, requires = "html")]
    scene: Option<PathBuf>,
    /// Number of frames over time 0 to 1, keyframes in a .glb; by default as many as the file was made from.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_FRAMES)), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// A single time, in [0, 1], for a .ply or .glb file; 0 where one is needed and none is given.
    #[arg(long, allow_negative_numbers = true, conflicts_with_all = ["frames", "fps"])]
    time: Option<f32>,
    /// Frames a second of a .4dgs or of a .glb that moves; by default those of the source, or 30.
    #[arg(long, allow_negative_numbers = true)]
    fps: Option<f32>,
    /// In a .glb: the scene's z axis points up, as in Blender. glTF's y axis does.
    #[arg(long)]
    z_up: bool,
    /// Back end: auto (a graphics card where there is one), ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long, default_value_t)]
    device: DeviceName,
    #[command(flatten)]
    limits: LimitsArgument,
}

/// The kind of output.
#[derive(Clone, Copy, Debug)]
enum Target {
    PlySequence,
    PlyZip,
    Ply,
    Glb,
    FourDgs,
}

impl Target {
    /// The kind of output for a path: a folder if it exists as one, ends with a slash or has no suffix.
    fn of(path: &Path) -> Result<Self, TrainError> {
        let asks_for_folder = path.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
        let Some(suffix) = path.extension().filter(|_| !asks_for_folder && !path.is_dir()) else {
            return Ok(Self::PlySequence);
        };
        match suffix.to_string_lossy().to_ascii_lowercase().as_str() {
            "ply" => Ok(Self::Ply),
            "zip" => Ok(Self::PlyZip),
            "glb" => Ok(Self::Glb),
            "4dgs" => Ok(Self::FourDgs),
            other => Err(TrainError::Input(format!(
                "--out {}: no file of the kind `.{other}` is written, only .ply, .zip, .glb and .4dgs; for a folder of PLY files put a \
                 slash at the end of the name",
                path.display()
            ))),
        }
    }
}

impl Export {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if let Some(time) = self.time.filter(|time| !(0.0..=1.0).contains(time)) {
            return Err(TrainError::Input(format!("--time must be in [0, 1], not {time}")));
        }
        match (&self.html, &self.out) {
            (Some(html), _) => self.write_page(html),
            (None, Some(out)) => self.export(out),
            (None, None) => unreachable!("one of the two is required"),
        }
    }

    fn write_page(&self, html: &Path) -> Result<(), TrainError> {
        check_output(html, &self.file)?;
        let (scene, StreamInfo { meta: SceneMeta { name, .. }, .. }) =
            read_stream(&self.file, &light4gs_web::limits())?;
        let cameras = dataset_cameras(&self.file, self.scene.as_deref(), MOST_CAMERAS)?;
        let title = if name.is_empty() { "Scene" } else { &name };
        let page = page(title, Content::Embedded { scene: &scene, cameras: &cameras }, None);
        write_atomically(html, |file| file.write_all(page.as_bytes()))?;
        say(format_args!("wrote {} ({:.2} MB)", html.display(), page.len() as f64 / 1e6))
    }

    fn export(&self, path: &Path) -> Result<(), TrainError> {
        let target = Target::of(path)?;
        if !matches!(target, Target::PlySequence) {
            check_output(path, &self.file)?;
        }
        let decoded: DecodedScene =
            DecodedScene::open_with_limits(&self.file, &self.limits.get(), &device::open(self.device)?)?;
        let at = |time: f32| plain_gaussians(decoded.model.at(time).to_arrays());
        let meta = &decoded.data.meta;
        let frames = frame_count(meta, self.frames)?;
        let times = || (0..frames).map(|k| if frames == 1 { 0.0 } else { k as f32 / (frames - 1) as f32 });
        let out = path.display();
        let gaussians = &decoded.data.gaussians;
        let single_time = self.time.unwrap_or(0.0);
        match target {
            Target::PlySequence => {
                let names = NumberedFiles::new(frames as usize, "ply");
                names.open_folder(path)?;
                for (k, time) in times().enumerate() {
                    at(time).write(&path.join(names.name(k)))?;
                }
                say(format_args!("wrote {frames} PLY files to {out}"))
            }
            Target::PlyZip => {
                write_ply_zip(path, times().map(at))?;
                say(format_args!("wrote {out} ({frames} PLY files)"))
            }
            Target::Ply => {
                at(single_time).write(path)?;
                say(format_args!("wrote {out}"))
            }
            Target::Glb => {
                let options = GlbOptions { sh_degree: gaussians.sh_degree, z_is_up: self.z_up };
                let nodes = match &decoded.model.field {
                    BuiltInField::Nodes(nodes) if self.time.is_none() => nodes,
                    _ => {
                        write_glb(path, &at(single_time), None, &options)?;
                        return say(format_args!("wrote {out}{}", left_out(gaussians, &[])));
                    }
                };
                let motion = NodesMotion { scene: &decoded.model, nodes, keyframes: frames, fps: self.fps(meta)? };
                let skin = motion.skin()?;
                write_glb(path, &plain_gaussians(gaussians.clone()), Some(&skin), &options)?;
                let (joints, seconds) = (skin.joints(), skin.duration());
                let Distances { mean, largest } = motion.distances(&skin);
                let left_out = left_out(gaussians, &[STILLNESS]);
                say(format_args!(
                    "wrote {out} ({joints} joints, {frames} keyframes in {seconds:.2} s; centers are off by {mean:.5} in \
                     the mean, by {largest:.5} at most){left_out}"
                ))
            }
            Target::FourDgs => {
                let fps = self.fps(meta)?;
                let sample = |(k, time): (usize, f32)| MotionSample { begin: k as f64 / fps, gaussians: at(time) };
                let samples: Vec<MotionSample> = times().enumerate().map(sample).collect();
                write_four_dgs(path, &samples, f64::from(frames) / fps)?;
                let left_out = left_out(gaussians, &[]);
                say(format_args!("wrote {out} ({frames} samples, {fps} a second){left_out}"))
            }
        }
    }

    /// Frames a second: as requested, or those of the source, or 30.
    fn fps(&self, meta: &SceneMeta) -> Result<f64, TrainError> {
        let source = Some(meta.fps).filter(|fps| *fps > 0.0);
        let fps = f64::from(self.fps.or(source).unwrap_or(30.0));
        let (least, most) = (FPS.start(), FPS.end());
        match self.fps {
            _ if FPS.contains(&fps) => Ok(fps),
            Some(fps) => Err(TrainError::Input(format!("--fps must be {least} to {most}, not {fps}"))),
            None => Err(TrainError::Input(format!(
                "the file says that it has {fps} frames a second, expected {least} to {most}; give a number with --fps"
            ))),
        }
    }
}

/// A text with the attributes that a file of another program cannot hold: all but the `held` ones.
fn left_out(gaussians: &GaussianArrays, held: &[&str]) -> String {
    let names = gaussians.further.iter().map(|attribute| attribute.name.as_str());
    let names: Vec<&str> = names.filter(|name| !held.contains(name)).collect();
    if names.is_empty() { String::new() } else { format!(", without the attributes {}", names.join(", ")) }
}

/// Gaussians for files of other programs, with harmonics of degree 3. A further attribute becomes properties `NAME_0`,
/// `NAME_1`...
fn plain_gaussians(arrays: GaussianArrays) -> GaussianPly {
    let per_gaussian = if arrays.is_empty() { 0 } else { arrays.sh_rest.len() / (3 * arrays.len()) };
    let rest = |i: usize| {
        std::array::from_fn(|coefficient| {
            if coefficient >= per_gaussian {
                return [0.0; 3];
            }
            let at = 3 * (i * per_gaussian + coefficient);
            [arrays.sh_rest[at], arrays.sh_rest[at + 1], arrays.sh_rest[at + 2]]
        })
    };
    let further = arrays.further.iter().flat_map(|attribute| {
        let column = move |channel: usize| {
            let values = attribute.values.iter().skip(channel).step_by(attribute.width as usize);
            (format!("{}_{channel}", attribute.name), values.copied().collect())
        };
        (0..attribute.width as usize).map(column)
    });
    GaussianPly {
        further: further.collect(),
        sh_rest: (0..arrays.means.len()).map(rest).collect(),
        means: arrays.means,
        sh_dc: arrays.sh_dc,
        opacity_logits: arrays.opacity_logits,
        log_scales: arrays.log_scales,
        quats: arrays.quats,
    }
}
