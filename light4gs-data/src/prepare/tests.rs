//! `prepare` with the real programs, on videos of a textured room. Skipped, with a message, where they are not
//! installed.

use super::*;
use crate::camera::Camera;
use crate::images::{ImageStore, RgbImage8};
use crate::options::LoadOptions;
use crate::programs::ffmpeg::tests::shown_at;
use crate::scene::Scene;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Width, height, and horizontal field of view (radians) of the videos.
const SIZE: (u32, u32) = (480, 360);
const FOV: f32 = 1.0;

fn installed() -> bool {
    let missing: Vec<String> =
        [FFMPEG.version().err(), Colmap::find().err()].into_iter().flatten().map(|e| e.to_string()).collect();
    for problem in &missing {
        println!("skipped: {problem}");
    }
    missing.is_empty()
}

/// A color of the room's walls: noise of several sizes, so that there is texture everywhere.
fn wall(point: Vec3) -> Vec3 {
    let hash = |cell: IVec3, salt: u32| {
        let mixed = cell.to_array().iter().fold(salt, |h, v| (h ^ *v as u32).wrapping_mul(0x9e37_79b1).rotate_left(13));
        (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b) as f32 / u32::MAX as f32
    };
    let layers = [(1.7, 1.0), (5.3, 1.0), (13.0, 0.8)];
    let channel = |salt: u32| {
        let sum: f32 = layers.iter().map(|(f, weight)| weight * hash((point * *f).floor().as_ivec3(), salt)).sum();
        sum / 2.8
    };
    Vec3::new(channel(1), channel(2), channel(3))
}

/// The image of a camera inside of the room: 2 × 2 rays a pixel.
fn photograph(camera: &Camera) -> RgbImage8 {
    let half = Vec3::new(3.0, 2.0, 4.0);
    let eye = camera.center();
    let color = |u: f32, v: f32| {
        let ray = camera.ray_direction(u, v);
        let inverse = ray.recip();
        let exit = (half * inverse.signum() - eye) * inverse;
        wall(eye + ray * exit.min_element() * 0.9999)
    };
    let pixels = (0..SIZE.0 * SIZE.1)
        .into_par_iter()
        .flat_map_iter(|i| {
            let (x, y) = ((i % SIZE.0) as f32, (i / SIZE.0) as f32);
            let samples = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)];
            let mean = samples.iter().map(|(dx, dy)| color(x + dx, y + dy)).sum::<Vec3>() / 4.0;
            mean.to_array().map(|v| (v * 255.0) as u8)
        })
        .collect();
    RgbImage8 { width: SIZE.0, height: SIZE.1, pixels }
}

fn camera(x: f32, y: f32) -> Camera {
    Camera::look_at(Vec3::new(x, y, 2.0), Vec3::new(0.2 * x, 0.0, -2.5), Vec3::Y, FOV, SIZE.0, SIZE.1)
}

/// Films at ten frames per second, or so that the frames are shown at some times.
fn film(folder: &Path, name: &str, cameras: &[Camera], times: Option<&[f64]>) -> PathBuf {
    let frames = folder.join(format!("{name}-frames"));
    fs::create_dir_all(&frames).unwrap();
    for (i, camera) in cameras.iter().enumerate() {
        photograph(camera).save_png(&frames.join(format!("{i:04}.png"))).unwrap();
    }
    let video = folder.join(format!("{name}.mp4"));
    let mut command = FFMPEG.command();
    command.args(["-loglevel", "error", "-framerate", "10", "-i"]).arg(frames.join("%04d.png"));
    if let Some(times) = times {
        command.args(["-vf", &shown_at(times), "-vsync", "0"]);
    }
    command.args(["-c:v", "libx264", "-crf", "10", "-pix_fmt", "yuv420p"]).arg(&video);
    FFMPEG.run(&mut command, "writing the video", "").unwrap();
    video
}

/// Checks that distances between the cameras agree with the true ones up to one scale, within 3 % of the largest.
fn same_shape(found: &[Vec3], truth: &[Vec3]) {
    let distances = |points: &[Vec3]| -> Vec<f32> {
        points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(|b| a.distance(*b))).collect()
    };
    let (found, truth) = (distances(found), distances(truth));
    let scale = truth.iter().sum::<f32>() / found.iter().sum::<f32>();
    let largest = truth.iter().copied().fold(0.0, f32::max);
    for (a, b) in found.iter().zip(&truth) {
        assert!((a * scale - b).abs() < 0.03 * largest, "{} instead of {b}", a * scale);
    }
}

#[test]
fn a_moving_camera_becomes_a_dataset_and_a_second_call_goes_on() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let truth: Vec<Camera> = (0..16).map(|i| camera(-1.2 + 0.16 * i as f32, 0.3 * (i as f32 * 0.5).sin())).collect();
    // The second half at half the rate.
    let times: Vec<f64> = (0..16).map(|i| if i < 8 { i as f64 / 10.0 } else { (i - 4) as f64 / 5.0 }).collect();
    let video = film(folder.path(), "walk", &truth, Some(&times));
    let mut options = PrepareOptions::new(vec![video], folder.path().join("out"));
    options.frames = 16;
    let mut phases = Vec::new();
    let summary = prepare(&options, &mut |event| {
        if let PrepareEvent::Progress { phase, done, total } = event {
            phases.push(phase);
            assert!(done <= total);
        }
    })
    .unwrap();
    phases.dedup();
    assert_eq!(phases, ["frames", "features", "matches", "poses", "dataset"]);
    assert!(summary.registered >= 15 && summary.frames == summary.registered, "{summary}");
    assert!(summary.reprojection_error < 1.0 && summary.points > 300, "{summary}");

    let load = LoadOptions::default();
    let scene = Scene::open(&options.out, &load).unwrap();
    assert_eq!(scene.layout, "nerfstudio");
    let frames: Vec<_> = scene.video.iter().collect();
    let index = |time: f32| times.iter().position(|t| (t / times[15] - f64::from(time)).abs() < 1e-3).unwrap();
    let found: Vec<Vec3> = frames.iter().map(|frame| frame.camera.center()).collect();
    let expected: Vec<Vec3> = frames.iter().map(|frame| truth[index(frame.time)].center()).collect();
    same_shape(&found, &expected);
    // Upright: the cameras' downward axis points down in the world.
    assert!(frames.iter().all(|frame| frame.camera.rotation.row(1).z < -0.8));
    // The focal length is found, and each image is that of its time.
    let focal = frames[0].camera.fx / truth[0].fx;
    assert!((focal - 1.0).abs() < 0.1, "{focal}");
    let image = ImageStore::new(&load, 1 << 22).get(&scene.train[3]).unwrap();
    let film = photograph(&truth[index(scene.train[3].time)]);
    let worst: u64 = image.pixels.iter().zip(&film.pixels).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    assert!(worst / (image.pixels.len() as u64) < 12, "{}", worst / image.pixels.len() as u64);

    // Nothing is done twice; a lost file is made again.
    fs::remove_file(options.out.join("transforms.json")).unwrap();
    let mut again = Vec::new();
    assert_eq!(prepare(&options, &mut |event| again.push(event)).unwrap(), summary);
    assert_eq!(again, [PrepareEvent::progress("dataset", 1, 1)]);
    options.frames = 8;
    assert!(prepare(&options, &mut |_| {}).unwrap_err().to_string().contains("other videos or options"));
}

#[test]
fn a_rig_becomes_a_dataset() {
    if !installed() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let truth: Vec<Camera> =
        (0..6).map(|i| camera(-1.2 + 0.48 * i as f32, if i % 2 == 0 { 0.2 } else { -0.2 })).collect();
    let videos = truth.iter().enumerate().map(|(i, camera)| film(folder.path(), &format!("v{i}"), &[*camera; 3], None));
    let options = PrepareOptions::new(videos.collect(), folder.path().join("out"));
    let summary = prepare(&options, &mut |_| {}).unwrap();
    assert_eq!((summary.images, summary.cameras), (6, summary.registered));
    assert!(summary.registered >= 5 && summary.frames == 3 * summary.registered, "{summary}");
    let scene = Scene::open(&options.out, &LoadOptions::default()).unwrap();
    let first: Vec<_> = scene.video.iter().filter(|frame| frame.time == 0.0).collect();
    let number = |name: &str| name[3..5].parse::<usize>().unwrap();
    let found: Vec<Vec3> = first.iter().map(|frame| frame.camera.center()).collect();
    let path = |frame: &crate::frame::Frame| number(&frame.name);
    let expected: Vec<Vec3> = first.iter().map(|frame| truth[path(frame)].center()).collect();
    same_shape(&found, &expected);
    assert!(scene.test.iter().all(|frame| frame.camera_id == 0));
}

#[test]
fn bad_options_and_videos_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let message = |options: &PrepareOptions| prepare(options, &mut |_| {}).unwrap_err().to_string();
    assert!(message(&PrepareOptions::new(vec![], out.clone())).contains("videos"));
    let missing = PrepareOptions::new(vec![folder.path().join("no.mp4")], out.clone());
    assert!(message(&missing).contains("no.mp4"));
    let text = folder.path().join("a.mp4");
    fs::write(&text, "not a video").unwrap();
    let options = PrepareOptions::new(vec![text], out.clone());
    assert!(message(&PrepareOptions { frames: 1, ..options.clone() }).contains("frames"));
    assert!(message(&PrepareOptions { max_width: 7, ..options.clone() }).contains("max_width"));
    assert!(!out.exists());
    if installed() {
        assert!(message(&options).contains("a.mp4"));
        // The command may be tried again.
        assert!(message(&options).contains("a.mp4"));
    }
}
