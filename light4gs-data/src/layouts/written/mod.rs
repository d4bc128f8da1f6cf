//! One synthetic scene, photographed through known lenses, written in every layout and read back. Points project to the
//! right places, undistorted images are those of a pinhole, times and splits are those of the layout.

pub(crate) mod capture;
pub(crate) mod colmap;
pub(crate) mod dnerf;
pub(crate) mod nerfies;
pub(crate) mod nerfstudio;
pub(crate) mod neu3d;

use crate::images::ImageStore;
use crate::options::LoadOptions;
use crate::scene::{Scene, Split};
use capture::{Capture, Shot};
use glam::Vec3;
use std::path::Path;

/// By how many pixels a point may be off.
const MOST_PIXELS: f32 = 0.5;
/// PSNR that an undistorted image must have against the pinhole's, dB. With an offset of half a pixel it would be below
/// 30.
const LEAST_PSNR: f64 = 33.0;

pub(crate) fn options() -> LoadOptions {
    LoadOptions { background: [0.0; 3], ..Default::default() }
}

/// Opens a written capture and compares every frame with its shot, which `shot_of` finds by the frame's name.
fn check(root: &Path, layout: &str, capture: &Capture, shot_of: impl Fn(&str) -> Option<usize>) -> Scene {
    let scene = Scene::open(root, &options()).unwrap();
    assert_eq!(scene.layout, layout);
    let store = ImageStore::new(&options(), 1 << 24);
    let mut seen = vec![false; capture.shots.len()];
    for frame in [Split::Train, Split::Test, Split::Val].iter().flat_map(|split| scene.frames(*split)) {
        let i = shot_of(&frame.name).unwrap_or_else(|| panic!("no shot for {}", frame.name));
        seen[i] = true;
        let shot = &capture.shots[i];
        let scale = frame.camera.width as f32 / shot.pinhole.width as f32;
        for k in 0..200 {
            let point = place(k);
            let (u, v, depth) = frame.camera.project(point);
            let (x, y, expected_depth) = shot.pinhole.project(point);
            let (x, y) = ((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5);
            let off = (u - x).hypot(v - y);
            assert!(off < MOST_PIXELS, "{layout} {}: {point} is {off} pixels off", frame.name);
            assert!((depth - expected_depth).abs() < 1e-3 * expected_depth.abs());
        }
        let found = store.get(frame).unwrap();
        let expected = capture.pinhole_image(i, (frame.camera.width, frame.camera.height));
        let psnr = psnr(&found.pixels, &expected.pixels, frame.camera.width as usize);
        assert!(psnr > LEAST_PSNR, "{layout} {}: {psnr:.1} dB", frame.name);
    }
    assert!(seen.iter().all(|seen| *seen), "{layout}: not every shot became a frame");
    scene
}

/// Points all over the scene.
fn place(k: u32) -> Vec3 {
    let part = |multiplier: u32| (k * multiplier % 97) as f32 / 48.0 - 1.0;
    Vec3::new(part(31), part(17), part(7))
}

/// Peak signal-to-noise ratio, decibels, without a margin of 3 pixels, where neighbors lie outside of the image.
fn psnr(a: &[u8], b: &[u8], width: usize) -> f64 {
    assert_eq!(a.len(), b.len());
    let height = a.len() / 3 / width;
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, (x, y)) in a.iter().zip(b).enumerate() {
        let (column, row) = (i / 3 % width, i / 3 / width);
        if (3..width - 3).contains(&column) && (3..height - 3).contains(&row) {
            sum += (f64::from(*x) - f64::from(*y)).powi(2);
            count += 1.0;
        }
    }
    10.0 * (255.0f64.powi(2) / (sum / count)).log10()
}

/// Sorted times of a split, each once.
fn times(scene: &Scene, split: Split) -> Vec<f32> {
    let mut times: Vec<f32> = scene.frames(split).iter().map(|frame| frame.time).collect();
    times.sort_by(f32::total_cmp);
    times.dedup();
    times
}

/// The shot with this name.
fn by_name(shots: &[Shot]) -> impl Fn(&str) -> Option<usize> + '_ {
    |name| shots.iter().position(|shot| shot.name == name)
}
