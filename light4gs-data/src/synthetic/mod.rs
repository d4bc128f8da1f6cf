//! The procedural scene of the quickstart: textured solids that bounce, swing and turn over a disc,
//! written in the D-NeRF layout, so that everything can be tried without any download.
//!
//! Everything stays within 1.25 world units of the origin. Training cameras sit at random on the
//! upper hemisphere (radius 4.03), each at its own time `i / (n - 1)`; test and validation cameras
//! circle the scene at times strictly inside (0, 1) that no training frame has.

mod render;
mod shapes;
mod world;

use crate::atomic::{make_folder_atomically, write_atomically};
use crate::camera::Camera;
use crate::error::DataError;
use crate::images::save_png;
use crate::orbit::orbit_path;
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
    if root.file_name().is_none() {
        return Err(DataError::Options {
            option: "root",
            problem: format!("`{}` has no folder name of its own", root.display()),
        });
    }
    let empty_folder = match fs::symlink_metadata(root) {
        Ok(kind) if kind.is_dir() => {
            let mut entries = fs::read_dir(root).map_err(DataError::io("read", root))?;
            entries.next().is_none()
        }
        Ok(_) => false,
        Err(_) => true,
    };
    if !empty_folder {
        return Err(DataError::Exists { path: root.to_path_buf() });
    }
    if let Some(parent) = root.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(parent).map_err(DataError::io("create", parent))?;
    }
    make_folder_atomically(root, |part| write_folder(part, options))
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
mod tests {
    use super::*;
    use crate::images::{ImageStore, Region, regions};
    use crate::options::LoadOptions;
    use crate::scene::Scene;
    use std::path::PathBuf;

    fn small(seed: u64) -> SyntheticOptions {
        SyntheticOptions { resolution: 32, train_frames: 5, test_frames: 3, val_frames: 2, seed }
    }

    fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                found.extend(contents(&path));
            } else {
                found.push((path.clone(), fs::read(&path).unwrap()));
            }
        }
        found.sort();
        found
    }

    #[test]
    fn the_same_options_give_the_same_files_and_nothing_else_remains() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["a", "b", "c"].map(|name| folder.path().join(name));
        for (name, seed) in names.iter().zip([3, 3, 4]) {
            write_synthetic(name, &small(seed)).unwrap();
        }
        let [a, b, c] = names.map(|name| {
            contents(&name)
                .into_iter()
                .map(|(path, bytes)| (path.strip_prefix(&name).unwrap().to_path_buf(), bytes))
                .collect::<Vec<_>>()
        });
        // 10 images, 3 transforms, 5 masks.
        assert_eq!(a.len(), 18);
        assert_eq!(a, b);
        assert_ne!(a, c);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn it_opens_as_a_scene_with_something_in_every_image() {
        let folder = tempfile::tempdir().unwrap();
        // An empty folder may be used; its parents are made.
        let root = folder.path().join("deep/scene");
        fs::create_dir_all(&root).unwrap();
        write_synthetic(&root, &small(0)).unwrap();
        let options = LoadOptions::default();
        let scene = Scene::open(&root, &options).unwrap();
        assert_eq!((scene.train.len(), scene.test.len(), scene.val.len()), (5, 3, 2));
        let times: Vec<f32> = scene.train.iter().map(|f| f.time).collect();
        assert_eq!(times, [0.0, 0.25, 0.5, 0.75, 1.0]);
        let store = ImageStore::new(&options, 1 << 20);
        for frame in scene.train.iter().chain(&scene.test).chain(&scene.val) {
            let center = frame.camera.center();
            assert!((center.length() - RADIUS).abs() < 1e-4 && center.z > 0.0);
            let image = store.get(frame).unwrap();
            let white = image.pixels.chunks_exact(3).filter(|p| **p == [255; 3]).count();
            assert!((100..924).contains(&white), "{}: {white} of 1024 are white", frame.name);
        }
        assert!(scene.train.iter().all(|frame| frame.mask.is_none()), "masks are for measuring");
        for frame in scene.test.iter().chain(&scene.val) {
            let [(Region::Moving, moving), (Region::Still, still)] = &regions(frame).unwrap()[..] else {
                panic!("{} has masks of motion", frame.name)
            };
            let image = store.get(frame).unwrap();
            let pixels = || image.pixels.chunks_exact(3).zip(&moving.pixels);
            let count = pixels().filter(|(_, moves)| **moves == 1).count();
            assert!((50..500).contains(&count), "{}: {count} of 1024 move", frame.name);
            assert!(pixels().all(|(color, moves)| *moves == 0 || *color != [255; 3]), "the background does not move");
            assert!(moving.pixels.iter().zip(&still.pixels).all(|(moving, still)| moving + still == 1));
        }
    }

    #[test]
    fn held_out_times_are_inside_and_never_trained() {
        for train in [2usize, 3, 5, 41, 100] {
            for count in [1usize, 2, 3, 10, 20, 50] {
                for i in 0..count {
                    let time = unseen_time(i, count, train);
                    assert!(time > 0.0 && time < 1.0);
                    let steps = time * (train - 1) as f32;
                    assert!((steps - steps.round()).abs() > 0.04, "{train} {count} {i}");
                }
            }
        }
    }

    #[test]
    fn nothing_is_overwritten_and_bad_options_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("a");
        fs::create_dir(&root).unwrap();
        fs::write(root.join("thesis.tex"), "x").unwrap();
        let refused = write_synthetic(&root, &small(0)).unwrap_err();
        assert!(matches!(refused, DataError::Exists { .. }), "{refused}");
        let file = root.join("thesis.tex");
        assert!(matches!(write_synthetic(&file, &small(0)), Err(DataError::Exists { .. })));
        let bad = SyntheticOptions { train_frames: 1, ..small(0) };
        let error = write_synthetic(&folder.path().join("b"), &bad).unwrap_err();
        assert!(error.to_string().contains("train_frames"), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
