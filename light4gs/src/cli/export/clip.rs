//! A scene of one stream.

use std::path::Path;

use light4gs_data::{GlbOptions, MotionSample, write_four_dgs, write_glb};
use light4gs_model::{BuiltInField, STILLNESS};
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::DecodedScene;

use super::super::limits::most::frame_count;
use super::super::output::say;
use super::Export;
use super::plain::{left_out, plain_gaussians};
use super::skin::{Distances, NodesMotion};
use super::target::{Target, write_ply_archive, write_ply_folder};

impl Export {
    pub(super) fn export_clip(&self, path: &Path, target: Target) -> Result<(), TrainError> {
        self.refuse_options_of_takes(target)?;
        let decoded: DecodedScene =
            DecodedScene::open_with_limits(&self.file, &self.limits.get(), &device::open(self.device)?)?;
        let at = |time: f32| plain_gaussians(decoded.model.at(time).to_arrays());
        let meta = &decoded.data.meta;
        let frames = frame_count(meta, self.frames)?;
        let time = |moment: f32| if frames == 1 { 0.0 } else { moment / (frames - 1) as f32 };
        let every_frame = || (0..frames as usize).map(|k| Ok(at(time(k as f32))));
        let out = path.display();
        let gaussians = &decoded.data.gaussians;
        let single_time = self.time.unwrap_or(0.0);
        match target {
            Target::PlySequence => write_ply_folder(path, every_frame()),
            Target::PlyZip => write_ply_archive(path, every_frame()),
            Target::Ply => {
                at(single_time).write(path)?;
                say(format_args!("wrote {out}"))
            }
            Target::Glb | Target::GlbSegments => {
                let options = GlbOptions { sh_degree: gaussians.sh_degree, z_is_up: self.z_up };
                let nodes = match &decoded.model.field {
                    BuiltInField::Nodes(nodes) if self.time.is_none() => nodes,
                    _ => {
                        write_glb(path, &at(single_time), None, &options)?;
                        return say(format_args!("wrote {out}{}", left_out([gaussians], &[])));
                    }
                };
                let (scene, fps) = (&decoded.model, self.fps(meta.fps)?);
                let motion = NodesMotion { scene, nodes, keyframes: frames, fps, time: &time, standing: 0 };
                let skin = motion.skin()?;
                write_glb(path, &plain_gaussians(gaussians.clone()), Some(&skin), &options)?;
                let (joints, seconds) = (skin.joints(), skin.duration());
                let mut distances = Distances::default();
                motion.add_distances(&skin, &mut distances);
                let left_out = left_out([gaussians], &[STILLNESS]);
                say(format_args!(
                    "wrote {out} ({joints} joints, {frames} keyframes in {seconds:.2} s; {distances}){left_out}"
                ))
            }
            Target::FourDgs => {
                let fps = self.fps(meta.fps)?;
                let samples = every_frame().enumerate().map(|(k, gaussians)| {
                    Ok::<_, TrainError>(MotionSample { begin: k as f64 / fps, anew: false, gaussians: gaussians? })
                });
                write_four_dgs(path, &at(0.0), samples, f64::from(frames) / fps)?;
                let left_out = left_out([gaussians], &[]);
                say(format_args!("wrote {out} ({frames} samples, {fps} a second){left_out}"))
            }
        }
    }

    fn refuse_options_of_takes(&self, target: Target) -> Result<(), TrainError> {
        let (option, remedy) = match () {
            () if self.at.is_some() => ("--at SECONDS", "--time, from 0 to 1"),
            () if self.base => ("--base", "--time, from 0 to 1"),
            () if target == Target::GlbSegments => ("--to glb", "--out scene.glb"),
            () => return Ok(()),
        };
        let file = self.file.display();
        Err(TrainError::Input(format!("{option} is for takes, and {file} is a scene of one part; use {remedy}")))
    }
}
