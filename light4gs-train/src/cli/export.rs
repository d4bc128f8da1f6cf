//! `export`.

use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_codec::GaussianArrays;
use light4gs_data::{DataError, GaussianPly, GlbOptions, MotionSample, write_four_dgs, write_glb};
use light4gs_model::{DeformationField, HexPlaneField, StillField};

use super::check_output;
use super::output::say;
use crate::config::DeviceName;
use crate::device;
use crate::error::TrainError;
use crate::evaluation::{DecodedScene, is_still};

#[derive(Debug, Args)]
pub(super) struct Export {
    /// The .l4gs file.
    file: PathBuf,
    /// A folder for `0000.ply`, `0001.ply`, ..., or a file: one moment as .ply or .glb (KHR_gaussian_splatting), the whole
    /// motion as .4dgs.
    #[arg(long)]
    out: PathBuf,
    /// Number of frames over time 0 to 1; as many as the file was made from if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    /// The moment of a .ply or .glb file, in [0, 1].
    #[arg(long, default_value_t = 0.0)]
    time: f32,
    /// Frames a second of a .4dgs file; the source's, or 30, if not given.
    #[arg(long)]
    fps: Option<f32>,
    /// In a .glb: the scene's z axis points up, as in Blender. glTF's y axis does.
    #[arg(long)]
    z_up: bool,
    /// Back end: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long, default_value_t)]
    device: DeviceName,
}

/// What is written.
#[derive(Clone, Copy, Debug)]
enum Target {
    PlySequence,
    Ply,
    Glb,
    FourDgs,
}

impl Target {
    fn of(path: &Path) -> Self {
        match path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("ply") => Self::Ply,
            Some("glb") => Self::Glb,
            Some("4dgs") => Self::FourDgs,
            _ => Self::PlySequence,
        }
    }
}

impl Export {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if !(0.0..=1.0).contains(&self.time) {
            return Err(TrainError::Input(format!("--time must be in [0, 1], not {}", self.time)));
        }
        match is_still(&self.file)? {
            true => self.export::<StillField>(),
            false => self.export::<HexPlaneField>(),
        }
    }

    fn export<F: DeformationField>(self) -> Result<(), TrainError> {
        let target = Target::of(&self.out);
        if !matches!(target, Target::PlySequence) {
            check_output(&self.out)?;
        }
        let decoded: DecodedScene<F> = DecodedScene::open(&self.file, &device::open(self.device)?)?;
        let at = |time: f32| plain_gaussians(decoded.model.at(time).to_arrays());
        let meta = &decoded.data.meta;
        let frames = self.frames.unwrap_or(meta.frame_count).max(1);
        let times = || (0..frames).map(|k| if frames == 1 { 0.0 } else { k as f32 / (frames - 1) as f32 });
        let out = self.out.display();
        match target {
            Target::PlySequence => {
                std::fs::create_dir_all(&self.out).map_err(DataError::io("create", &self.out))?;
                for (k, time) in times().enumerate() {
                    at(time).write(&self.out.join(format!("{k:04}.ply")))?;
                }
                say(format_args!("wrote {frames} PLY files to {out}"))
            }
            Target::Ply => {
                at(self.time).write(&self.out)?;
                say(format_args!("wrote {out}"))
            }
            Target::Glb => {
                let options = GlbOptions { sh_degree: decoded.data.gaussians.sh_degree, z_is_up: self.z_up };
                write_glb(&self.out, &at(self.time), &options)?;
                say(format_args!("wrote {out}"))
            }
            Target::FourDgs => {
                let source = Some(meta.fps).filter(|fps| *fps > 0.0);
                let fps = f64::from(self.fps.or(source).unwrap_or(30.0));
                if !(fps > 0.0 && fps.is_finite()) {
                    return Err(TrainError::Input(format!("--fps must be a positive number, not {fps}")));
                }
                let sample = |(k, time): (usize, f32)| MotionSample { begin: k as f64 / fps, gaussians: at(time) };
                let samples: Vec<MotionSample> = times().enumerate().map(sample).collect();
                write_four_dgs(&self.out, &samples, f64::from(frames) / fps)?;
                say(format_args!("wrote {out} ({frames} samples, {fps} a second)"))
            }
        }
    }
}

/// For files of other programs, whose harmonics have degree 3.
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
    GaussianPly {
        sh_rest: (0..arrays.means.len()).map(rest).collect(),
        means: arrays.means,
        sh_dc: arrays.sh_dc,
        opacity_logits: arrays.opacity_logits,
        log_scales: arrays.log_scales,
        quats: arrays.quats,
    }
}
