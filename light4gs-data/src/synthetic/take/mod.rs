//! Takes: a room in which things come, go, rest and pass each other for as long as is asked for, as one moving camera or a
//! rig that stands still records it.
//!
//! World units are about two thirds of a meter: the room is 9 units wide, and a figure is 1.4 tall and walks half a unit a second.
//! The middle of the floor is the origin, and z points up.

mod actor;
mod cameras;
mod choreography;
mod room;
mod stage;

use super::folder::make_new_folder;
use super::render::{rays, supersample};
use crate::atomic::write_atomically;
use crate::camera::Camera;
use crate::error::DataError;
use crate::images::save_png;
use crate::numbered::NumberedFiles;
use crate::ply::Encoding;
use crate::points::PointCloud;
use cameras::Cameras;
use image::ExtendedColorType;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde_json::{Value, json};
use stage::Stage;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// Rays of a pixel along each side.
const SAMPLES: u32 = 2;
/// Points of the cloud to start from.
const POINTS: usize = 20_000;
/// Most images of a take.
const MOST_IMAGES: f64 = 500_000.0;

/// Options of [`write_take`].
#[derive(Clone, Debug, PartialEq)]
pub struct TakeOptions {
    /// Length of the take, seconds; 1 to 3600.
    pub seconds: f64,
    /// Cameras to train on: 1 moves on a smooth path; 2 to 64 stand still, with one more for testing.
    pub cameras: usize,
    /// Frames per second; 1 to 240.
    pub frames_a_second: f64,
    /// Width of the images, pixels; 8 to 4096.
    pub width: u32,
    /// Height of the images, pixels; 8 to 4096.
    pub height: u32,
    /// When the moving camera jumps to another place, seconds.
    pub cut: Option<f64>,
    /// When the light begins to change, seconds; it changes within half a second.
    pub light: Option<f64>,
    /// Seed of room, cast and cameras.
    pub seed: u64,
}

impl Default for TakeOptions {
    /// 60 seconds at 30 frames per second of one moving camera, 320 × 240 pixels, without a cut, in the same light; seed 0.
    fn default() -> Self {
        Self {
            seconds: 60.0,
            cameras: 1,
            frames_a_second: 30.0,
            width: 320,
            height: 240,
            cut: None,
            light: None,
            seed: 0,
        }
    }
}

impl TakeOptions {
    /// Frames of each camera.
    fn frames(&self) -> usize {
        ((self.seconds * self.frames_a_second).round() as usize).max(2)
    }

    fn check(&self) -> Result<(), DataError> {
        let bad = |option: &'static str, problem: String| Err(DataError::Options { option, problem });
        let ranges = [
            ("seconds", self.seconds, 1.0, 3600.0),
            ("cameras", self.cameras as f64, 1.0, 64.0),
            ("frames_a_second", self.frames_a_second, 1.0, 240.0),
            ("width", self.width.into(), 8.0, 4096.0),
            ("height", self.height.into(), 8.0, 4096.0),
        ];
        for (option, found, least, most) in ranges {
            if !(least..=most).contains(&found) {
                return bad(option, format!("{found}, expected {least} to {most}"));
            }
        }
        for (option, found) in [("cut", self.cut), ("light", self.light)] {
            if let Some(found) = found.filter(|found| !(*found > 0.0 && *found < self.seconds)) {
                return bad(
                    option,
                    format!("{found}, expected a second within the take, between 0 and {}", self.seconds),
                );
            }
        }
        if self.cut.is_some() && self.cameras > 1 {
            return bad("cut", format!("{} cameras stand still; only a camera that moves jumps", self.cameras));
        }
        let images = self.frames() as f64 * (self.cameras + 1) as f64;
        if images > MOST_IMAGES {
            return bad(
                "seconds",
                format!("{images} images, expected at most {MOST_IMAGES}: fewer seconds, frames or cameras"),
            );
        }
        Ok(())
    }
}

/// Writes a take as a new folder in the layout `nerfstudio`: `transforms.json` with `fps` and the `time` of each frame in
/// seconds, RGB images, and `points3D.ply` with points on the surfaces at time 0. The folder is complete or absent, never
/// half-written. Each image is written as soon as it is rendered, so memory does not grow with the take.
///
/// Images of one moving camera are `images/0000.png`...; every eighth is for testing, as in every capture without splits. Those
/// of a rig are `images/cam00/0000.png`..., and `cam00` is for testing. The same options give the same files.
///
/// # Errors
/// [`DataError::Exists`] when `root` is there and not an empty folder; [`DataError::Options`] when an option is out of range;
/// [`DataError::Io`] when something cannot be written.
pub fn write_take(root: &Path, options: &TakeOptions) -> Result<(), DataError> {
    options.check()?;
    make_new_folder(root, |folder| write_folder(folder, options))
}

fn write_folder(folder: &Path, options: &TakeOptions) -> Result<(), DataError> {
    let cameras = Cameras::new(options);
    let stage = Stage::new(options, &cameras);
    let first = cameras.at(0.0);
    let files = NumberedFiles::new(options.frames(), "png");
    let name = |camera: usize, frame: usize| {
        let file = files.name(frame);
        if cameras.is_rig() { format!("images/cam{camera:02}/{file}") } else { format!("images/{file}") }
    };
    for camera in 0..first.len() {
        let path = folder.join(name(camera, 0));
        let images = path.parent().unwrap_or(folder);
        fs::create_dir_all(images).map_err(DataError::io("create", images))?;
    }
    let seconds = |frame: usize| frame as f64 / options.frames_a_second;
    (0..options.frames()).into_par_iter().try_for_each(|frame| {
        let now = seconds(frame) as f32;
        let moment = stage.at(now);
        cameras.at(now).iter().enumerate().try_for_each(|(number, camera)| {
            let eye = camera.center();
            let see = |ray| {
                let (_, color, moves) = moment.see(eye, ray);
                Some((color, moves))
            };
            let rendering = supersample((camera.width, camera.height), SAMPLES, rays(camera), see);
            // Walls are everywhere, so that every pixel is opaque.
            let pixels: Vec<u8> =
                rendering.rgba.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
            let path = folder.join(name(number, frame));
            save_png(&path, &pixels, camera.width, camera.height, ExtendedColorType::Rgb8)
        })
    })?;
    points(&stage, &cameras, options).write_ply(&folder.join("points3D.ply"), Encoding::BinaryLittleEndian)?;
    let names = |cameras: std::ops::Range<usize>| -> Vec<String> {
        cameras.flat_map(|camera| (0..options.frames()).map(move |frame| name(camera, frame))).collect()
    };
    let mut head = vec![
        ("fps", json!(options.frames_a_second)),
        ("ply_file_path", json!("points3D.ply")),
        ("camera_model", json!("PINHOLE")),
        ("w", json!(options.width)),
        ("h", json!(options.height)),
        ("fl_x", json!(first[0].fx)),
        ("fl_y", json!(first[0].fy)),
        ("cx", json!(first[0].cx)),
        ("cy", json!(first[0].cy)),
    ];
    if cameras.is_rig() {
        head.push(("train_filenames", json!(names(1..first.len()))));
        head.push(("test_filenames", json!(names(0..1))));
    }
    let frame = |number: usize, frame: usize, camera: &Camera| {
        json!({
            "file_path": name(number, frame),
            "time": seconds(frame),
            "transform_matrix": camera.camera_to_world_opengl(),
        })
    };
    write_atomically(&folder.join("transforms.json"), |out| {
        let numbers = (0..first.len()).flat_map(|number| (0..options.frames()).map(move |i| (number, i)));
        let frames = numbers.map(|(number, i)| frame(number, i, &cameras.at(seconds(i) as f32)[number]));
        write_transforms(out, &head, frames)
    })
}

/// Writes frames one after the other: all of a long take together would take much memory.
fn write_transforms(
    out: &mut impl Write,
    head: &[(&str, Value)],
    frames: impl Iterator<Item = Value>,
) -> io::Result<()> {
    writeln!(out, "{{")?;
    for (key, value) in head {
        writeln!(out, "  {}: {value},", json!(key))?;
    }
    write!(out, "  \"frames\": [")?;
    for (i, frame) in frames.enumerate() {
        write!(out, "{}\n    {frame}", if i > 0 { "," } else { "" })?;
    }
    writeln!(out, "\n  ]\n}}")
}

/// Points where random pixels of the cameras, at any time, see the world as it is at time 0.
fn points(stage: &Stage, cameras: &Cameras, options: &TakeOptions) -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0x706f_696e);
    let moment = stage.at(0.0);
    let mut cloud = PointCloud::default();
    for _ in 0..POINTS {
        let seen_by = cameras.at(rng.random_range(0.0..options.seconds as f32));
        let camera = &seen_by[rng.random_range(0..seen_by.len())];
        let (u, v) = (rng.random_range(0.0..camera.width as f32), rng.random_range(0.0..camera.height as f32));
        let (eye, ray) = (camera.center(), rays(camera)(u, v));
        let (distance, color, _) = moment.see(eye, ray);
        cloud.positions.push((eye + ray * distance).to_array());
        cloud.colors.push(color.to_array().map(|value| value.clamp(0.0, 1.0)));
    }
    cloud
}

#[cfg(test)]
mod tests;
