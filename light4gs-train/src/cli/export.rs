//! `export`.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_codec::read_info;
use light4gs_data::{DataError, GaussianPly, write_atomically};
use light4gs_web::page::{Content, page};

use super::check_output;
use super::limits::LimitsArgument;
use super::most::{MOST_FRAMES, frame_count};
use super::output::say;
use super::view::dataset_cameras;
use crate::config::DeviceName;
use crate::device;
use crate::error::TrainError;
use crate::evaluation::DecodedScene;

/// Cameras of each split that a page holds: enough to choose from, few enough to send.
const MOST_CAMERAS: usize = 60;

#[derive(Debug, Args)]
pub(super) struct Export {
    /// The .l4gs file.
    file: PathBuf,
    /// Folder for `0000.ply`, `0001.ply`, ...
    #[arg(long, required_unless_present = "html")]
    out: Option<PathBuf>,
    /// One file that plays the scene in a browser and needs nothing else.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "frames", "device"])]
    html: Option<PathBuf>,
    /// Dataset whose cameras the page offers; those of the run that the file lies in if not given.
    #[arg(long, requires = "html")]
    scene: Option<PathBuf>,
    /// Number of frames over time 0 to 1; as many as the file was made from if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_FRAMES)), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// Back end: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long, default_value_t)]
    device: DeviceName,
    #[command(flatten)]
    limits: LimitsArgument,
}

impl Export {
    pub(super) fn run(self) -> Result<(), TrainError> {
        match (&self.html, &self.out) {
            (Some(html), _) => self.write_page(html),
            (None, Some(out)) => self.write_frames(out),
            (None, None) => unreachable!("one of the two is required"),
        }
    }

    fn write_page(&self, html: &Path) -> Result<(), TrainError> {
        check_output(html)?;
        let name = read_info(&self.file)?.meta.name;
        let io = |source| DataError::Io { action: "read", path: self.file.clone(), source };
        let scene = std::fs::read(&self.file).map_err(io)?;
        let cameras = dataset_cameras(&self.file, self.scene.as_deref(), MOST_CAMERAS)?;
        let title = if name.is_empty() { "Scene" } else { &name };
        let page = page(title, Content::Embedded { scene: &scene, cameras: &cameras }, None);
        write_atomically(html, |file| file.write_all(page.as_bytes()))?;
        say(format_args!("wrote {} ({:.2} MB)", html.display(), page.len() as f64 / 1e6))
    }

    fn write_frames(&self, out: &Path) -> Result<(), TrainError> {
        let decoded: DecodedScene =
            DecodedScene::open_with_limits(&self.file, &self.limits.get(), &device::open(self.device)?)?;
        let frames = frame_count(&decoded.data.meta, self.frames)?;
        std::fs::create_dir_all(out).map_err(|source| DataError::Io {
            action: "create",
            path: out.to_owned(),
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
            ply.write(&out.join(format!("{k:04}.ply")))?;
        }
        say(format_args!("wrote {frames} PLY files to {}", out.display()))
    }
}
