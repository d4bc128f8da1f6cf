//! `export`.
//!
//! | file | what |
//! |---|---|
//! | `target` | the kind of output that a name asks for |
//! | `clip` | a scene of one stream |
//! | `take` | a take: frames and segments, one after the other |
//! | `skin` | the motion of control nodes as joints |
//! | `plain` | Gaussians for files of other programs |
//! | `site` | a folder for a static server |

mod clip;
mod plain;
mod site;
mod skin;
mod take;
mod target;

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use clap::Args;
use light4gs_codec::take::Take;
use light4gs_codec::{SceneMeta, StreamInfo, read_stream};
use light4gs_data::{DataError, write_atomically};
use light4gs_train::config::DeviceName;
use light4gs_train::error::TrainError;
use light4gs_web::page::{Content, page};

use self::target::{FolderOf, Target};
use super::check_output;
use super::limits::LimitsArgument;
use super::limits::most::MOST_FRAMES;
use super::output::say;
use super::take::is_take_file;
use super::view::dataset_cameras;

/// Most cameras of each split in a page: enough to choose from, few enough to send.
const MOST_CAMERAS: usize = 60;
/// Frames per second, so that times of frames are different numbers.
const FPS: RangeInclusive<f64> = 1e-3..=1e5;

#[derive(Debug, Args)]
pub(super) struct Export {
    /// The .l4gs file, a scene or a take; or the folder of a run or of a take.
    #[arg(value_name = "FILE|RUN")]
    file: PathBuf,
    /// Folder or file; the suffix of its name chooses the format. The output is a folder if its name has no suffix or
    /// ends in a slash, or if the folder exists already. A folder gets `0000.ply`, `0001.ply`, ...; it must not hold
    /// numbered PLY files of another sequence. A .zip gets the same PLY files, a .ply gets a single time, and a .4dgs
    /// gets the whole motion. A .glb (KHR_gaussian_splatting) gets the whole motion of control nodes (skin and
    /// animation); for other fields, or with --time, a .glb gets a single time. A .ply or .glb of a take gets a single
    /// time (--at) or the base alone (--base). With --to glb, each segment of a take gets a .glb.
    #[arg(long, required_unless_present_any = ["html", "site"])]
    out: Option<PathBuf>,
    /// Kind of the files in the folder. `ply` writes a file for each frame. `glb`, for takes only, writes a file for
    /// each segment, with the segment's motion and the still Gaussians that are drawn with it. `glb` also writes
    /// `base.glb`, with what stands still over the whole take, and `segments.json`, with the times of each segment.
    #[arg(long, value_enum, value_name = "KIND", default_value = "ply")]
    to: FolderOf,
    /// A single time of a take in seconds, for a .ply or .glb file.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, conflicts_with_all = ["frames", "fps", "time"])]
    at: Option<f64>,
    /// Write only what stands still over the whole take, for a .ply or .glb file. The beginning of the take's file is
    /// enough for this, since it holds the index and the base.
    #[arg(long, conflicts_with_all = ["frames", "fps", "time", "at"])]
    base: bool,
    /// A page that plays the scene in a browser without any other file.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "frames", "device", "time", "fps", "z_up", "limits", "at", "base"])]
    html: Option<PathBuf>,
    /// A folder to write, which any static server can serve: the page `index.html`, the player, the file, cameras, and
    /// a picture for previews of the page's link.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["html", "out", "frames", "device", "time", "fps", "z_up", "limits", "at", "base"])]
    site: Option<PathBuf>,
    /// The address at which the folder of --site will be. Previews of links need this address to show the picture.
    #[arg(long, value_name = "ADDRESS", requires = "site")]
    url: Option<String>,
    /// The title of the page, and of previews of the page's link; by default the name stored in the file.
    #[arg(long, value_name = "TEXT", conflicts_with = "out")]
    title: Option<String>,
    /// Dataset whose cameras the page offers; by default the dataset of the run whose folder holds the file.
    #[arg(long, conflicts_with = "out")]
    scene: Option<PathBuf>,
    /// Number of frames from time 0 to time 1; in a .glb, number of keyframes. By default, the number of frames that
    /// the file records.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_FRAMES)), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// A single time, in [0, 1], for a .ply or .glb file. An output that can hold only one time gets time 0 by default.
    #[arg(long, allow_negative_numbers = true, conflicts_with_all = ["frames", "fps"])]
    time: Option<f32>,
    /// Frames per second of a .4dgs, of a .glb with motion, and of the PLY files of a take; by default the source's
    /// rate, or 30 if it is not known.
    #[arg(long, allow_negative_numbers = true)]
    fps: Option<f32>,
    /// In a .glb, turn a scene whose z axis points up, as in Blender, so that its y axis points up, as in glTF.
    #[arg(long)]
    z_up: bool,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0.
    #[arg(long, default_value_t)]
    device: DeviceName,
    #[command(flatten)]
    limits: LimitsArgument,
}

/// The title of a page: what was asked for, else the name in the file.
fn title_of<'a>(wanted: Option<&'a str>, name: &'a str) -> &'a str {
    wanted.or(Some(name).filter(|name| !name.is_empty())).unwrap_or("A scene that moves")
}

impl Export {
    pub(super) fn run(mut self) -> Result<(), TrainError> {
        if self.file.is_dir() {
            self.file = file_of_run(&self.file)?;
        }
        if let Some(time) = self.time.filter(|time| !(0.0..=1.0).contains(time)) {
            return Err(TrainError::Input(format!("--time must be in [0, 1], not {time}")));
        }
        match (&self.html, &self.site, &self.out) {
            (Some(html), ..) => self.write_page(html),
            (None, Some(site), _) => self.write_site(site),
            (None, None, Some(out)) => self.export(out),
            (None, None, None) => unreachable!("one of the three is required"),
        }
    }

    fn write_page(&self, html: &Path) -> Result<(), TrainError> {
        check_output(html, &self.file)?;
        let (scene, name) = if is_take_file(&self.file) { self.whole_take()? } else { self.whole_scene()? };
        let cameras = dataset_cameras(&self.file, self.scene.as_deref(), MOST_CAMERAS)?;
        let title = title_of(self.title.as_deref(), &name);
        let page = page(title, Content::Embedded { scene: &scene, cameras: &cameras }, None);
        write_atomically(html, |file| file.write_all(page.as_bytes()))?;
        say(format_args!("wrote {} ({:.2} MB)", html.display(), page.len() as f64 / 1e6))
    }

    fn write_site(&self, folder: &Path) -> Result<(), TrainError> {
        site::write(folder, &self.file, self.scene.as_deref(), self.title.as_deref(), self.url.as_deref())
    }

    /// The bytes of a scene, and its name.
    fn whole_scene(&self) -> Result<(Vec<u8>, String), TrainError> {
        let (scene, StreamInfo { meta: SceneMeta { name, .. }, .. }) =
            read_stream(&self.file, &light4gs_web::limits())?;
        Ok((scene, name))
    }

    /// The bytes of a take, and its name. A page is read as a whole, so it may be no longer than a scene.
    fn whole_take(&self) -> Result<(Vec<u8>, String), TrainError> {
        let file = &self.file;
        let limits = light4gs_web::limits();
        let take = Take::open(file, &limits)?;
        let bytes = std::fs::read(file).map_err(DataError::io("read", file))?;
        if bytes.len() as u64 > limits.file_bytes {
            return Err(TrainError::Input(format!(
                "{} has {} bytes, and a page holds at most {}; `light4gs view` plays longer takes, and so does a page that loads \
                 the file from a server",
                file.display(),
                bytes.len(),
                limits.file_bytes
            )));
        }
        Ok((bytes, take.meta().name.clone()))
    }

    fn export(&self, path: &Path) -> Result<(), TrainError> {
        let target = Target::of(path, self.to)?;
        if !target.is_folder() {
            check_output(path, &self.file)?;
        }
        if is_take_file(&self.file) { self.export_take(path, target) } else { self.export_clip(path, target) }
    }

    /// Frames per second: as requested, or those of the source, or 30.
    fn fps(&self, source: f32) -> Result<f64, TrainError> {
        let source = Some(source).filter(|fps| *fps > 0.0);
        let fps = f64::from(self.fps.or(source).unwrap_or(30.0));
        let (least, most) = (FPS.start(), FPS.end());
        match self.fps {
            _ if FPS.contains(&fps) => Ok(fps),
            Some(fps) => Err(TrainError::Input(format!("--fps must be {least} to {most}, not {fps}"))),
            None => Err(TrainError::Input(format!(
                "the file says that it has {fps} frames per second, expected {least} to {most}; give a number with --fps"
            ))),
        }
    }
}

/// The file of a run, or of a take.
fn file_of_run(folder: &Path) -> Result<PathBuf, TrainError> {
    let names = ["take.l4gs", "scene.l4gs"].map(|name| folder.join(name));
    let found = names.into_iter().find(|file| file.is_file());
    found.ok_or_else(|| {
        let folder = folder.display();
        TrainError::Input(format!(
            "{folder} has neither scene.l4gs nor take.l4gs; name a .l4gs file, or the folder of a run that is finished"
        ))
    })
}
