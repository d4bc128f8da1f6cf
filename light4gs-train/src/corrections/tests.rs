use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::{Camera, PointCloud, SplitFrames};
use light4gs_model::{GaussianTensors, GaussiansConfig, Splatter};

use super::*;

const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];
const SIDE: u32 = 24;
const SCHEDULE: Schedule = Schedule { iterations: 100, views: 1 };

fn camera(angle: f32) -> Camera {
    let eye = [4.0 * angle.cos(), 4.0 * angle.sin(), 0.5];
    Camera::look_at(eye.into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.6, SIDE, SIDE)
}

/// Frames of `cameras` that stand still, at `times` times each.
fn rig(cameras: u32, times: usize) -> Scene {
    let frames: Vec<Frame> = (0..cameras)
        .flat_map(|id| {
            let time = move |k: usize| k as f32 / (times - 1) as f32;
            (0..times).map(move |k| Frame {
                camera_id: id,
                ..Frame::without_image(format!("{id}-{k}"), camera(id as f32), time(k))
            })
        })
        .collect();
    let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
    Scene::new("memory", Path::new("rig"), frames, PointCloud::random(30, 0.8, 0), [0.0; 3]).unwrap()
}

fn all(unit: CorrectionUnit) -> CorrectionsConfig {
    CorrectionsConfig { exposure: unit, poses: unit, time_offsets: true, ..CorrectionsConfig::default() }
}

/// Gaussians that move along a curve, without harmonics above degree 0. With `size` 0 each of them covers the whole image, so
/// that no pixel comes to its edge, where the image jumps.
fn at(time: f32, size: f32, device: &Device) -> GaussianTensors {
    let gaussians = GaussiansConfig::new().with_sh_degree(0).with_opacity(0.6);
    let cloud = PointCloud::random(12, 0.8, 3);
    let still = gaussians.init(&cloud, device).tensors();
    let shape = still.means.dims();
    let place = |k: usize| {
        let k = k as f32;
        0.3 * (2.0 * time + k).sin() + 0.1 * time * k.cos()
    };
    let change = Tensor::from_data(TensorData::new((0..shape[0] * 3).map(place).collect::<Vec<f32>>(), shape), device);
    let log_scales: Vec<f32> = (0..shape[0] * 3).map(|k| size + 0.3 * (k as f32).sin()).collect();
    GaussianTensors {
        means: still.means.detach() + change,
        log_scales: Tensor::from_data(TensorData::new(log_scales, shape), device),
        quats: still.quats.detach(),
        opacity_logits: still.opacity_logits.detach(),
        sh_dc: still.sh_dc.detach(),
        sh_rest: still.sh_rest.detach(),
        further: Vec::new(),
    }
}

/// Weights of the pixels that vary slowly.
fn weights(device: &Device) -> Tensor<3> {
    let side = SIDE as usize;
    let value = |k: usize| ((k % (3 * side)) as f32 * 0.11).cos() + ((k / (3 * side)) as f32 * 0.2).sin();
    let values: Vec<f32> = (0..side * side * 3).map(value).collect();
    Tensor::from_data(TensorData::new(values, [side, side, 3]), device)
}

fn of_numbers(numbers: [f32; 13]) -> ViewCorrection {
    let part = |from: usize| std::array::from_fn(|k| numbers[from + k]);
    ViewCorrection {
        exposure: Some(part(0)),
        pose: Some(Pose::of(part(6))),
        intervals: Some(numbers[12]),
        learns_time: true,
        interval: 0.1,
        background: BACKGROUND,
    }
}

/// The gradient of each of the 13 numbers is that of the corrected image, also where the correction is not 0.
#[test]
fn gradients_are_those_of_the_corrected_image() {
    let splatter = Splatter::new(BACKGROUND, 0);
    let frame = Frame::without_image("view", camera(0.3), 0.45);
    let numbers = [0.2, -0.1, 0.05, 0.03, -0.02, 0.1, 0.05, -0.08, 0.1, 0.06, -0.04, 0.1, 0.3];

    let device = Device::flex();
    let loss = |numbers: [f32; 13]| {
        let correction = of_numbers(numbers);
        let seen = correction.frame(&frame);
        let rendering = splatter.render(at(seen.time, 0.0, &device), &seen.camera, None);
        let values = Tensor::from_floats(correction.exposure.unwrap(), &device);
        let image = exposed(rendering.image, rendering.alpha, values, BACKGROUND);
        (image * weights(&device)).sum().into_scalar::<f64>()
    };

    let tape_device = device.clone().autodiff();
    let correction = of_numbers(numbers);
    let learned = correction.on_tape(&tape_device);
    let seen = correction.frame(&frame);
    let gaussians = learned.at_time(at(seen.time, 0.0, &tape_device), seen.time, |time| at(time, 0.0, &device));
    let gaussians = learned.turned(gaussians, &frame.camera, &seen.camera);
    let rendering = splatter.render(gaussians, &seen.camera, None);
    let image = learned.exposed(rendering.image, rendering.alpha);
    let sum = (image * weights(&tape_device)).sum();
    // What has no value changes nothing.
    assert!((sum.clone().into_scalar::<f64>() - loss(numbers)).abs() < 1e-4);
    let gradient = learned.gradient(&mut sum.backward()).unwrap();
    let gradient = correction.gradient(&gradient.into_data().iter::<f32>().collect::<Vec<_>>(), 1.0);
    let found = [&gradient.exposure.unwrap()[..], &gradient.pose.unwrap(), &[gradient.time.unwrap()]].concat();

    for (k, found) in found.into_iter().enumerate() {
        let step = if k == 12 { 0.5 } else { 2e-3 };
        let moved = |by: f32| {
            let mut numbers = numbers;
            numbers[k] += by;
            loss(numbers)
        };
        let expected = (moved(step) - moved(-step)) / f64::from(2.0 * step);
        let error = (f64::from(found) - expected).abs();
        assert!(error < 0.01 * expected.abs() + 0.02, "number {k}: {found}, by differences {expected}");
    }
}

#[test]
fn a_single_camera_differs_from_nothing() {
    let one = rig(1, 5);
    assert!(Corrections::new(&all(CorrectionUnit::Camera), &one, SCHEDULE).is_off());
    assert!(!Corrections::new(&all(CorrectionUnit::Frame), &one, SCHEDULE).is_off());
    assert!(Corrections::new(&CorrectionsConfig::default(), &rig(3, 5), SCHEDULE).is_off());
    let rig = Corrections::new(&all(CorrectionUnit::Camera), &rig(3, 5), SCHEDULE);
    let rows = [rig.exposures.unwrap().len(), rig.poses.unwrap().len(), rig.times.unwrap().len()];
    assert_eq!(rows, [3; 3]);
    // A camera that moves has no pose of its own to correct.
    let mut moving = self::rig(3, 5);
    moving.train[0].camera = camera(0.5);
    assert!(Corrections::new(&all(CorrectionUnit::Camera), &moving, SCHEDULE).poses.is_none());
    assert_eq!(Corrections::new(&all(CorrectionUnit::Frame), &moving, SCHEDULE).poses.unwrap().len(), 4);
}

/// All images brighter, all cameras turned about the middle and away from it, all of them late: the scene could do this as
/// well.
#[test]
fn what_is_common_to_all_is_not_learned() {
    let data = rig(5, 3);
    let mut corrections = Corrections::new(&all(CorrectionUnit::Frame), &data, SCHEDULE);
    let turn = glam::Vec3::new(0.01, -0.02, 0.005);
    let middle = (0..5).map(|id| camera(id as f32).center()).sum::<glam::Vec3>() / 5.0;
    for (id, row) in corrections.poses.as_mut().unwrap().values.iter_mut().enumerate() {
        let camera = camera(id as f32);
        let [a, b, c] = (camera.rotation * turn).to_array();
        // Seen from the cameras, the world turns by `turn`; they go round the middle the other way.
        let from_middle = camera.center() - middle;
        let moved = -turn.cross(from_middle) + 0.01 * from_middle;
        let [x, y, z] = (-(camera.rotation * moved)).to_array();
        *row = [a, b, c, x, y, z];
    }
    corrections.exposures.as_mut().unwrap().values.fill([0.1; 6]);
    corrections.times.as_mut().unwrap().values = vec![[0.5], [0.5], [0.8], [0.5], [0.5]];
    corrections.keep_what_images_do_not_tell();
    for row in corrections.poses.unwrap().values {
        assert!(row.iter().all(|value| value.abs() < 1e-6), "{row:?}");
    }
    assert!(corrections.exposures.unwrap().values.iter().flatten().all(|value| value.abs() < 1e-6));
    let times = corrections.times.unwrap().values;
    assert!((times[2][0] - 0.3).abs() < 1e-6 && times[0][0] == 0.0, "{times:?}");
}

#[test]
fn a_checkpoint_restores_all_numbers_and_nothing_else() {
    let data = rig(3, 4);
    let mut corrections = Corrections::new(&all(CorrectionUnit::Frame), &data, SCHEDULE);
    let gradient = GradientOfView { exposure: Some([0.1; 6]), pose: Some([-0.2; 6]), time: Some(0.3) };
    corrections.learn([(0, &gradient), (5, &gradient)], 50);
    corrections.learn([(0, &gradient)], 51);
    let mut again = Corrections::new(&all(CorrectionUnit::Frame), &data, SCHEDULE);
    again.restore(corrections.state()).unwrap();
    assert_eq!(again.state(), corrections.state());
    assert_eq!(
        (again.exposures, again.poses, again.times),
        (corrections.exposures.clone(), corrections.poses.clone(), corrections.times.clone())
    );

    type Changed<'a> = &'a mut BTreeMap<String, Vec<f32>>;
    let refused = |change: &dyn Fn(Changed)| {
        let mut state = corrections.state();
        change(&mut state);
        Corrections::new(&all(CorrectionUnit::Frame), &data, SCHEDULE).restore(state).unwrap_err()
    };
    assert!(refused(&|state| drop(state.remove("pose.first"))).contains("`corrections.pose.first` is missing"));
    assert!(refused(&|state| state.get_mut("time.values").unwrap().push(0.0)).contains("has 4 numbers, expected 3"));
    assert!(refused(&|state| state.get_mut("exposure.second").unwrap()[3] = -1.0).contains("exposure.second"));
    assert!(refused(&|state| state.get_mut("exposure.steps").unwrap()[3] = 0.5).contains("exposure.steps"));
    assert!(
        refused(&|state| drop(state.insert("gamma.values".into(), vec![1.0]))).contains("corrections.gamma.values")
    );
}

/// A view that is darker, turned and late is fitted; the scene is as it was.
#[test]
fn a_fit_finds_what_a_view_has() {
    let device = Device::flex();
    let splatter = Splatter::new(BACKGROUND, 0);
    let frame = Frame::without_image("view", camera(0.3), 0.45);
    let made = of_numbers([-0.2, -0.1, 0.1, 0.02, 0.0, -0.03, 0.006, -0.005, 0.01, 0.02, -0.01, 0.03, 0.6]);
    let seen = made.frame(&frame);
    let render = |camera: &Camera, time: f32| splatter.render(at(time, -1.6, &device), camera, None);
    let rendering = render(&seen.camera, seen.time);
    let truth =
        exposed(rendering.image, rendering.alpha, Tensor::from_floats(made.exposure.unwrap(), &device), BACKGROUND);
    let error = |image: &Tensor<3>| (image.clone() - truth.clone()).powi_scalar(2).mean().into_scalar::<f64>();
    let plain = error(&render(&frame.camera, frame.time).image);
    let fit = ViewFit { exposure: true, pose: true, time: true, interval: 0.1, background: BACKGROUND };
    let (fitted, image) = fit.fit(&frame, &truth, render);
    assert!(error(&image) < 1e-3 * plain, "{} of {plain}", error(&image));
    let turn = fitted.pose.unwrap().rotation;
    for (found, made) in turn.into_iter().zip([0.006, -0.005, 0.01]) {
        assert!((found - made).abs() < 0.002, "{turn:?}");
    }
    // Alone, the exposure cannot explain it.
    let fit = ViewFit { pose: false, time: false, ..fit };
    let (fitted, image) = fit.fit(&frame, &truth, render);
    assert!(fitted.pose.is_none() && fitted.frames.is_none());
    assert!(error(&image) < 0.7 * plain && error(&image) > 1e-3 * plain);
}
