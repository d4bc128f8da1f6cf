//! Trainings of small scenes whose images and cameras have a made fault: the corrections that are learned undo it.

use std::path::Path;

use glam::{Mat3, Quat, Vec3};
use light4gs_data::{Camera, Frame, PointCloud, RgbImage8, Scene, Split, SplitFrames};
use light4gs_model::{DynamicSceneConfig, GaussiansConfig, Splatter, StillField};
use light4gs_train::config::Config;
use light4gs_train::corrections::{CorrectionsRecord, Exposure};
use light4gs_train::dataset::MemoryImages;
use light4gs_train::trainer::Trainer;

use burn::tensor::{Device, Tensor};

const CAMERAS: u32 = 8;
const SIDE: u32 = 48;

fn camera(id: u32) -> Camera {
    let angle = id as f32 * std::f32::consts::TAU / CAMERAS as f32;
    let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0 + (id % 3) as f32);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.55, SIDE, SIDE)
}

/// A camera after a turn in its own axes.
fn turned(camera: Camera, turn: Quat) -> Camera {
    Camera { rotation: Mat3::from_quat(turn) * camera.rotation, translation: turn * camera.translation, ..camera }
}

/// A still scene of opaque Gaussians in many colors, seen by a rig, and what its cameras record. `gain` is that of a camera;
/// `turn` turns it in its own axes after the dataset was written.
fn capture(gain: impl Fn(u32) -> f32, turn: impl Fn(u32) -> Quat) -> (Scene, MemoryImages) {
    let device = Device::flex();
    let cloud = PointCloud::random(150, 0.8, 5);
    let gaussians = GaussiansConfig::new().with_sh_degree(0).with_opacity(0.95);
    let truth = DynamicSceneConfig::<StillField>::new(gaussians, ()).init(&cloud, &device).gaussians.tensors();
    let shape = truth.log_scales.dims();
    let truth = light4gs_model::GaussianTensors { log_scales: Tensor::full(shape, -2.0, &device), ..truth };
    let mut frames = Vec::new();
    let mut images = Vec::new();
    for id in 0..CAMERAS {
        let given = camera(id);
        let real = turned(given, turn(id));
        let image = Splatter::new([0.0; 3], 0).render(truth.clone(), &real, None).image;
        let byte = |value: f32| (value * gain(id) * 255.0).round().clamp(0.0, 255.0) as u8;
        let pixels = image.into_data().iter::<f32>().map(byte).collect();
        for time in [0.0, 1.0] {
            let name = format!("{id}-{time}");
            frames.push(Frame { camera_id: id, ..Frame::without_image(name.clone(), given, time) });
            images.push((name, RgbImage8 { width: SIDE, height: SIDE, pixels: Vec::clone(&pixels) }));
        }
    }
    let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
    let data = Scene::new("memory", Path::new("rig"), frames, cloud, [0.0; 3]).unwrap();
    (data, images.into_iter().collect())
}

/// The mean loss of the last iterations, and what was learned.
fn trained((data, images): (Scene, MemoryImages), keys: &[&str]) -> (f32, Option<CorrectionsRecord>) {
    const KEYS: [&str; 10] = [
        "device=flex",
        "model.field=still",
        "model.sh_degree=0",
        "train.coarse_iterations=0",
        "train.fine_iterations=800",
        "train.densify.strategy=none",
        "train.prune.fraction=0",
        "compression.rate.lambda=0",
        "eval.interval=0",
        "train.corrections.from=50",
    ];
    let keys: Vec<String> = KEYS.iter().chain(keys).map(|key| (*key).to_owned()).collect();
    let config = Config::load("hexplane-dnerf-cpu", &keys).unwrap();
    let mut trainer = Trainer::builder(config, data).images(images).build().unwrap();
    let mut losses = Vec::new();
    while let Some(step) = trainer.step().unwrap() {
        losses.push(step.loss);
    }
    assert!(trainer.psnr(Split::Test).unwrap().is_finite());
    let last = &losses[losses.len() - 32..];
    (last.iter().sum::<f32>() / last.len() as f32, trainer.corrections().record())
}

/// Two of eight cameras are 25 % and 15 % too dark. The median of the gains is 1, so theirs are what was made.
#[test]
fn made_gains_are_recovered() {
    let gain = |id: u32| match id {
        2 => 0.75,
        5 => 0.85,
        _ => 1.0,
    };
    let faulty = || capture(gain, |_| Quat::IDENTITY);
    let (plain, none) = trained(faulty(), &[]);
    assert!(none.is_none());
    let (corrected, learned) = trained(faulty(), &["train.exposure=camera"]);
    assert!(corrected < 0.7 * plain, "a loss of {corrected}, without corrections {plain}");
    let exposures = learned.unwrap().exposures;
    assert_eq!(exposures.len(), CAMERAS as usize);
    for exposure in exposures {
        let Exposure { gain: gains, offset } = exposure.exposure;
        for (found, offset) in gains.into_iter().zip(offset) {
            // Of middle gray: a gain and an offset can stand in for each other where colors are alike.
            let (found, made) = (found + 2.0 * offset, gain(exposure.camera));
            assert!((found / made - 1.0).abs() < 0.06, "camera {}: {found}, not {made}", exposure.camera);
        }
    }
}

/// Cameras look 0.7 degrees too high and too low in turn, which no motion of the scene explains. A translation would do as well
/// as a turn where things are about as far away: what counts is where they are in the image.
#[test]
fn made_turns_are_recovered() {
    let turn = |id: u32| Quat::from_rotation_x(if id.is_multiple_of(2) { 0.7f32 } else { -0.7 }.to_radians());
    let faulty = || capture(|_| 1.0, turn);
    let (plain, _) = trained(faulty(), &[]);
    let (corrected, learned) = trained(faulty(), &["train.poses=camera"]);
    assert!(corrected < 0.6 * plain, "a loss of {corrected}, without corrections {plain}");
    let poses = learned.unwrap().poses;
    assert_eq!(poses.len(), CAMERAS as usize);
    // Where the scene's middle is in the image, pixels.
    let row = |camera: Camera| camera.fy * camera.translation.y / camera.translation.z;
    let (mut made, mut left) = (0.0, 0.0);
    for pose in poses {
        let given = camera(pose.camera);
        let real = row(turned(given, turn(pose.camera)));
        made += (real - row(given)).abs() / CAMERAS as f32;
        left += (real - row(pose.pose.corrected(&given))).abs() / CAMERAS as f32;
    }
    assert!(made > 0.9 && left < 0.3 * made, "{left} of {made} pixels are left");
}
