//! Each rule with a capture that has the fault, and with one that has not.

use super::*;
use crate::{Camera, Frame, PointCloud, SplitFrames};
use glam::Vec3;
use std::path::Path;

/// A camera at `angle` on a circle around the points, which looks at them.
fn around(angle: f32) -> Camera {
    let eye = Vec3::new(4.0 * angle.sin(), 0.0, 4.0 * angle.cos());
    Camera::look_at(eye, Vec3::ZERO, Vec3::Y, 0.9, 64, 48)
}

/// Twelve images of a camera.
fn scene(camera: impl Fn(f32) -> Camera) -> Scene {
    let frame = |i: u16| Frame::without_image(format!("{i}"), camera(f32::from(i)), f32::from(i) / 11.0);
    let splits = SplitFrames { test: vec![frame(0)], train: (1..12).map(frame).collect(), ..Default::default() };
    Scene::new("a", Path::new("a"), splits, PointCloud::random(200, 1.0, 0), [0.0; 3]).unwrap()
}

fn good() -> Scene {
    scene(|i| around(0.1 * i))
}

/// Twelve sharp images in which something moves steadily.
fn curve(camera_id: u32) -> CameraCurve {
    CameraCurve {
        camera_id,
        name: format!("cam{camera_id}"),
        times: (0..12).map(|k| k as f32 / 11.0).collect(),
        sharpness: vec![0.2; 12],
        changes: vec![0.01; 11],
        log_gains: vec![0.0; 11],
        far_change: 0.04,
        every: 1,
        still: true,
    }
}

fn only(scene: &Scene, curves: &[CameraCurve], word: &str) {
    let faults = capture_faults(scene, curves);
    assert!(faults.len() == 1 && faults[0].contains(word), "{faults:?}");
}

#[test]
fn a_good_capture_has_no_faults() {
    assert_eq!(capture_faults(&good(), &[curve(0), curve(1)]), Vec::<String>::new());
    assert_eq!(capture_faults(&good(), &[]), Vec::<String>::new());
}

#[test]
fn cameras_in_one_place_and_little_parallax_are_told_apart() {
    let turning = scene(|i| {
        let eye = Vec3::new(0.0, 0.0, 4.0 + 1e-3 * i);
        Camera::look_at(eye, Vec3::new(0.02 * i, 0.0, 0.0), Vec3::Y, 0.9, 64, 48)
    });
    only(&turning, &[curve(0)], "all cameras are in one place (0.2 degrees");
    only(&scene(|i| around(0.01 * i)), &[curve(0)], "little parallax (6.2 degrees");
}

#[test]
fn few_images_with_a_pose() {
    let mut scene = good();
    scene.reading.unposed = 2;
    assert_eq!(capture_faults(&scene, &[]), Vec::<String>::new());
    scene.reading.unposed = 4;
    only(&scene, &[curve(0)], "12 of 16 images have a pose");
}

#[test]
fn blur_of_some_images_and_of_all() {
    let mut some = curve(0);
    some.sharpness[3] = 0.1;
    assert_eq!(capture_faults(&good(), &[some.clone()]), Vec::<String>::new());
    some.sharpness[8] = 0.14;
    // A camera that is somewhere else for each image sees other things.
    let elsewhere = CameraCurve { still: false, changes: vec![0.04; 11], ..some.clone() };
    assert_eq!(capture_faults(&good(), &[elsewhere]), Vec::<String>::new());
    only(
        &good(),
        &[some],
        "2 of 12 images that were looked at are blurred, compared with those around them (most: camera cam0, time 0.273)",
    );
    let all = CameraCurve { sharpness: vec![0.07; 12], ..curve(0) };
    only(&good(), &[all], "no detail at the size at which they are used");
    let none = CameraCurve { sharpness: vec![f32::NAN; 12], ..curve(0) };
    assert_eq!(capture_faults(&good(), &[none]), Vec::<String>::new());
}

#[test]
fn exposure_that_jumps() {
    let mut jumps = curve(0);
    jumps.log_gains[4] = 0.03;
    jumps.log_gains[5] = -0.2;
    assert_eq!(capture_faults(&good(), &[jumps.clone()]), Vec::<String>::new());
    jumps.log_gains[6] = 0.18;
    only(&good(), &[jumps], "the exposure jumps 2 times in 11 pairs of images, by up to 22 %");
}

#[test]
fn motion_that_is_too_fast_for_the_rate() {
    let fast = CameraCurve { changes: vec![0.038; 11], ..curve(0) };
    only(&good(), std::slice::from_ref(&fast), "too fast for the rate");
    // The same numbers of a camera that moves, of one of which few images were looked at, and of noise, say nothing.
    for other in [
        CameraCurve { still: false, ..fast.clone() },
        CameraCurve { every: 2, ..fast.clone() },
        CameraCurve { far_change: 0.002, changes: vec![0.002; 11], ..fast },
    ] {
        assert_eq!(capture_faults(&good(), &[other]), Vec::<String>::new());
    }
}

#[test]
fn a_camera_out_of_step() {
    let jerks = |ahead: i32| {
        let change = |k: i32| if [2, 3, 7].contains(&(k + ahead)) { 0.03 } else { 0.01 };
        (0..11).map(change).collect::<Vec<f32>>()
    };
    let rig = |ahead| {
        [0, 1, 2].map(|id| CameraCurve {
            changes: jerks(if id == 1 { ahead } else { 0 }),
            far_change: 0.1,
            ..curve(id)
        })
    };
    assert_eq!(capture_faults(&good(), &rig(0)), Vec::<String>::new());
    only(&good(), &rig(2), "camera cam1 is 2 frames ahead of the others");
}
