//! `export`.

use std::path::PathBuf;

use clap::Args;
use light4gs_data::{DataError, GaussianPly};

use super::limits::{MOST_FRAMES, frame_count};
use super::output::say;
use crate::config::DeviceName;
use crate::device;
use crate::error::TrainError;
use crate::evaluation::DecodedScene;

#[derive(Debug, Args)]
pub(super) struct Export {
    /// The .l4gs file.
    file: PathBuf,
    /// Folder for `0000.ply`, `0001.ply`, ...
    #[arg(long)]
    out: PathBuf,
    /// Number of frames over time 0 to 1; as many as the file was made from if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_FRAMES)), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// Back end: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long, default_value_t)]
    device: DeviceName,
}

impl Export {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let decoded: DecodedScene = DecodedScene::open(&self.file, &device::open(self.device)?)?;
        let frames = frame_count(&decoded.data.meta, self.frames)?;
        std::fs::create_dir_all(&self.out).map_err(|source| DataError::Io {
            action: "create",
            path: self.out.clone(),
            source,
        })?;
        for k in 0..frames {
            let time = if frames == 1 { 0.0 } else { k as f32 / (frames - 1) as f32 };
            let arrays = decoded.model.at(time).to_arrays();
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
            let ply = GaussianPly {
                sh_rest: (0..arrays.means.len()).map(rest).collect(),
                means: arrays.means,
                sh_dc: arrays.sh_dc,
                opacity_logits: arrays.opacity_logits,
                log_scales: arrays.log_scales,
                quats: arrays.quats,
            };
            ply.write(&self.out.join(format!("{k:04}.ply")))?;
        }
        say(format_args!("wrote {frames} PLY files to {}", self.out.display()))
    }
}
