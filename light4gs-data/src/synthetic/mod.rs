//! Procedural scenes, so that everything can be tried without any download. `take/` has those that last.
//!
//! The scene of the quickstart: textured solids that bounce, swing and turn over a disc, written in the D-NeRF layout.
//! Everything stays within 1.25 world units of the origin. Training cameras sit at random on the
//! upper hemisphere (radius 4.03), each at its own time `i / (n - 1)`; test and validation cameras
//! circle the scene at times strictly inside (0, 1) that no training frame has.

mod folder;
mod light;
mod render;
mod shapes;
mod solid;
mod take;
mod texture;
mod world;

pub use take::{TakeOptions, write_take};

use crate::atomic::write_atomically;
use crate::camera::Camera;
use crate::error::DataError;
use crate::images::save_png;
use crate::orbit::orbit_path;
use folder::make_new_folder;
use glam::Vec3;
use image::ExtendedColorType;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::fs;
use std::io::Write;
use std::path::Path;
use world::World;

/// Distance of every camera to the origin, world units.
const RADIUS: f32 = 4.03;
/// Full horizontal field of view, radians: that of the Blender scenes of NeRF.
const FOV_X: f32 = 0.691_111_2;
/// Elevations of the test and validation orbits, degrees.
const ELEVATIONS: [f32; 2] = [30.0, 50.0];

/// Options of [`write_synthetic`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntheticOptions {
    /// Width and height of the images, pixels; 8 to 4096.
    pub resolution: u32,
    /// Number of training frames; 2 to 10000.
    pub train_frames: usize,
    /// Number of test frames; 1 to 10000.
    pub test_frames: usize,
    /// Number of validation frames; 0 leaves the split out.
    pub val_frames: usize,
    /// Seed of cameras, colors and textures.
    pub seed: u64,
}

impl Default for SyntheticOptions {
    /// 200 × 200 pixels; 100 training, 20 test, 10 validation frames; seed 0.
    fn default() -> Self {
        Self { resolution: 200, train_frames: 100, test_frames: 20, val_frames: 10, seed: 0 }
    }
}

impl SyntheticOptions {
    fn check(&self) -> Result<(), DataError> {
        let ranges = [
            ("resolution", self.resolution as usize, 8, 4096),
            ("train_frames", self.train_frames, 2, 10_000),
            ("test_frames", self.test_frames, 1, 10_000),
            ("val_frames", self.val_frames, 0, 10_000),
        ];
        for (option, found, least, most) in ranges {
            if !(least..=most).contains(&found) {
                return Err(DataError::Options { option, problem: format!("{found}, expected {least} to {most}") });
            }
        }
        Ok(())
    }
}

/// Writes the procedural scene as a new D-NeRF folder: `transforms_{train,test,val}.json` and
/// RGBA images `train/r_000.png`..., and masks of the moving pixels for the test and validation views,
/// `mask/test/r_000.png`...; the folder is complete or absent, never half-written.
///
/// The same options give the same files.
///
/// # Errors
/// [`DataError::Exists`] when `root` is there and not an empty folder; [`DataError::Options`] when an
/// option is out of range; [`DataError::Io`] when something cannot be written.
pub fn write_synthetic(root: &Path, options: &SyntheticOptions) -> Result<(), DataError> {
    options.check()?;
    make_new_folder(root, |part| write_folder(part, options))
}

/// The procedural scene, for tests that photograph it with other cameras.
#[cfg(test)]
pub(crate) struct Studio(World);

#[cfg(test)]
impl Studio {
    pub(crate) fn new(seed: u64) -> Self {
        Self(World::new(seed))
    }

    /// `[H, W, 3]` bytes on black, see [`render::render_rays`].
    pub(crate) fn photograph(
        &self,
        eye: Vec3,
        size: (u32, u32),
        time: f32,
        direction: impl Fn(f32, f32) -> Vec3,
    ) -> crate::images::RgbImage8 {
        let rendering = render::render_rays(&self.0, eye, size, time, direction);
        let pixels = crate::images::composite(&rendering.rgba, [0.0; 3]);
        crate::images::RgbImage8 { width: size.0, height: size.1, pixels }
    }
}

fn write_folder(folder: &Path, options: &SyntheticOptions) -> Result<(), DataError> {
    let world = World::new(options.seed);
    let intrinsics = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, FOV_X, options.resolution, options.resolution);
    let train = train_views(options, &intrinsics);
    let orbit = |count: usize, elevation: f32| -> Vec<(Camera, f32)> {
        orbit_path(count, RADIUS, elevation, &intrinsics)
            .into_iter()
            .enumerate()
            .map(|(i, (camera, _))| (camera, unseen_time(i, count, options.train_frames)))
            .collect()
    };
    write_split(folder, "train", None, &train, &world)?;
    write_split(folder, "test", Some("mask/test"), &orbit(options.test_frames, ELEVATIONS[0]), &world)?;
    if options.val_frames > 0 {
        write_split(folder, "val", Some("mask/val"), &orbit(options.val_frames, ELEVATIONS[1]), &world)?;
    }
    Ok(())
}

/// Random cameras on the upper hemisphere (uniform in area), in the order of their times.
fn train_views(options: &SyntheticOptions, intrinsics: &Camera) -> Vec<(Camera, f32)> {
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    (0..options.train_frames)
        .map(|i| {
            let height = rng.random_range(0.1f32..0.95);
            let angle = rng.random_range(0.0..TAU);
            let across = (1.0 - height * height).sqrt();
            let eye = RADIUS * Vec3::new(across * angle.cos(), across * angle.sin(), height);
            let (width, tall) = (intrinsics.width, intrinsics.height);
            let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, FOV_X, width, tall);
            (camera, i as f32 / (options.train_frames - 1) as f32)
        })
        .collect()
}

/// A time strictly inside (0, 1) for view `i` of `count`, well away from the training times.
fn unseen_time(i: usize, count: usize, train_frames: usize) -> f32 {
    let time = (i as f64 + 0.5) / count as f64;
    let steps = (train_frames - 1) as f64;
    let from_grid = (time * steps - (time * steps).round()).abs();
    if from_grid > 0.05 {
        time as f32
    } else {
        // Less than one step before the end, since 1 itself is never used.
        ((((time * steps).round().min(steps - 1.0)) + 0.25) / steps) as f32
    }
}

/// Writes transforms and images of a split, and masks where a folder for them is named.
fn write_split(
    folder: &Path,
    split: &str,
    masks: Option<&str>,
    views: &[(Camera, f32)],
    world: &World,
) -> Result<(), DataError> {
    let images = folder.join(split);
    let masks = masks.map(|masks| folder.join(masks));
    for made in std::iter::once(&images).chain(&masks) {
        fs::create_dir_all(made).map_err(DataError::io("create", made))?;
    }
    views.par_iter().enumerate().try_for_each(|(i, (camera, time))| {
        let rendering = render::render(world, camera, *time);
        let name = format!("r_{i:03}.png");
        let save = |folder: &Path, pixels: &[u8], color| {
            save_png(&folder.join(&name), pixels, camera.width, camera.height, color)
        };
        save(&images, &rendering.rgba, ExtendedColorType::Rgba8)?;
        masks.as_ref().map_or(Ok(()), |masks| save(masks, &rendering.moving, ExtendedColorType::L8))
    })?;
    let frames: Vec<serde_json::Value> = views
        .iter()
        .enumerate()
        .map(|(i, (camera, time))| {
            serde_json::json!({
                "file_path": format!("./{split}/r_{i:03}"),
                "time": time,
                "transform_matrix": camera.camera_to_world_opengl(),
            })
        })
        .collect();
    let document = serde_json::json!({ "camera_angle_x": FOV_X, "frames": frames });
    let path = folder.join(format!("transforms_{split}.json"));
    write_atomically(&path, |out| writeln!(out, "{document:#}"))
}

#[cfg(test)]
mod tests;
