//! Takes as they are written and read back.

use super::*;
use crate::images::ImageStore;
use crate::options::LoadOptions;
use crate::scene::Scene;

fn small() -> TakeOptions {
    TakeOptions { seconds: 4.0, frames_a_second: 8.0, width: 48, height: 36, ..Default::default() }
}

fn written(options: &TakeOptions) -> (tempfile::TempDir, Scene) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("take");
    write_take(&root, options).unwrap();
    let scene = Scene::open(&root, &LoadOptions::default()).unwrap();
    (folder, scene)
}

#[test]
fn one_moving_camera_reads_back() {
    let (_folder, scene) = written(&small());
    assert_eq!((scene.layout, scene.train.len(), scene.test.len()), ("nerfstudio", 28, 4));
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
    assert!((scene.seconds.unwrap() - 31.0 / 8.0).abs() < 1e-9);
    assert_eq!((scene.train[0].time, scene.train[27].time, scene.points.len()), (0.0, 1.0, POINTS));
    // Points are on surfaces: each has the color that the first image has there, but for what hides it.
    let camera = scene.train[0].camera;
    let image = ImageStore::new(&LoadOptions::default(), 1 << 20).get(&scene.train[0]).unwrap();
    let (mut near, mut seen) = (0, 0);
    for (position, color) in scene.points.positions.iter().zip(&scene.points.colors) {
        let (u, v, depth) = camera.project((*position).into());
        let (x, y) = (u.round(), v.round());
        if depth > 0.1 && (0.0..48.0).contains(&x) && (0.0..36.0).contains(&y) {
            let at = 3 * (y as usize * 48 + x as usize);
            let off = (0..3).map(|c| (f32::from(image.pixels[at + c]) / 255.0 - color[c]).abs()).fold(0.0, f32::max);
            (near, seen) = (near + usize::from(off < 0.15), seen + 1);
        }
    }
    assert!(seen > 2000 && near > seen / 2, "{near} of {seen}");
}

#[test]
fn a_rig_reads_back_with_its_first_camera_for_testing() {
    let (folder, scene) = written(&TakeOptions { cameras: 2, ..small() });
    assert_eq!((scene.train.len(), scene.test.len(), scene.val.len()), (64, 32, 0));
    assert!(scene.test.iter().all(|frame| frame.path.starts_with(folder.path().join("take/images/cam00"))));
    assert!(scene.test.iter().all(|frame| frame.camera == scene.test[0].camera));
}

#[test]
fn the_same_options_give_the_same_files() {
    let bytes = |options: &TakeOptions| {
        let (folder, scene) = written(options);
        let root = folder.path().join("take");
        let mut all: Vec<Vec<u8>> = scene.train.iter().map(|frame| fs::read(&frame.path).unwrap()).collect();
        all.extend(["transforms.json", "points3D.ply"].map(|name| fs::read(root.join(name)).unwrap()));
        all
    };
    let first = bytes(&small());
    assert_eq!(first, bytes(&small()));
    assert_ne!(first, bytes(&TakeOptions { seed: 1, ..small() }));
}

#[test]
fn light_and_cut_act_when_they_should() {
    let mean = |scene: &Scene, i: usize| {
        let mut frames: Vec<_> = scene.train.iter().chain(&scene.test).collect();
        frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        let image = ImageStore::new(&LoadOptions::default(), 1 << 20).get(frames[i]).unwrap();
        image.pixels.iter().map(|value| f64::from(*value)).sum::<f64>() / image.pixels.len() as f64
    };
    let (_a, plain) = written(&small());
    let (_b, lit) = written(&TakeOptions { light: Some(2.0), ..small() });
    assert_eq!(mean(&plain, 16), mean(&lit, 16));
    assert!(mean(&lit, 20) < 0.9 * mean(&plain, 20));
    let (_c, cut) = written(&TakeOptions { cut: Some(2.0), ..small() });
    let center = |scene: &Scene, i: usize| scene.train[i].camera.center();
    assert_eq!(center(&plain, 3), center(&cut, 3));
    assert!(center(&plain, 27).distance(center(&cut, 27)) > 1.0);
}

/// A camera that is held still for a fifth of a second sees which pixels change.
#[test]
fn cameras_see_motion_almost_all_the_time() {
    for (cameras, seed) in [(1, 0), (1, 1), (4, 2)] {
        let options = TakeOptions { width: 40, height: 30, cameras, seed, ..Default::default() };
        let cameras = Cameras::new(&options);
        let stage = Stage::new(&options, &cameras);
        let share = |seconds: f32| {
            let (now, later) = (stage.at(seconds), stage.at(seconds + 0.2));
            let camera = cameras.at(seconds)[0];
            let (eye, ray) = (camera.center(), rays(&camera));
            let changed = |k: u32| {
                let ray = ray((k % 40) as f32 + 0.5, (k / 40) as f32 + 0.5);
                now.see(eye, ray).1.distance(later.see(eye, ray).1) > 0.03
            };
            (0..40 * 30).filter(|k| changed(*k)).count() as f32 / 1200.0
        };
        let shares: Vec<f32> = (0..118).map(|k| share(0.5 * k as f32)).collect();
        let seen = shares.iter().filter(|share| **share > 0.003).count() as f32 / shares.len() as f32;
        let mean = shares.iter().sum::<f32>() / shares.len() as f32;
        assert!(seen > 0.85 && (0.01..0.3).contains(&mean), "motion in {seen} of the views, {mean} of the pixels");
    }
}

#[test]
fn bad_options_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let bad = [
        ("seconds", TakeOptions { seconds: f64::NAN, ..small() }),
        ("seconds", TakeOptions { seconds: 3600.0, frames_a_second: 240.0, ..small() }),
        ("cameras", TakeOptions { cameras: 0, ..small() }),
        ("frames_a_second", TakeOptions { frames_a_second: 0.0, ..small() }),
        ("width", TakeOptions { width: 0, ..small() }),
        ("cut", TakeOptions { cut: Some(4.0), ..small() }),
        ("cut", TakeOptions { cut: Some(2.0), cameras: 3, ..small() }),
        ("light", TakeOptions { light: Some(-1.0), ..small() }),
    ];
    for (name, options) in bad {
        let refused = write_take(&folder.path().join("a"), &options).unwrap_err();
        assert!(matches!(&refused, DataError::Options { option, .. } if *option == name), "{refused}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// The images are links to one file, so that the page cache holds them as it would hold the headers of others.
#[test]
#[ignore = "it measures time: alone, with --ignored --nocapture"]
fn six_thousand_frames_open_within_seconds() {
    let (folder, _) = written(&TakeOptions { cameras: 19, seconds: 1.0, frames_a_second: 2.0, ..small() });
    let root = folder.path().join("take");
    let instants = 300;
    let mut document: Value = serde_json::from_slice(&fs::read(root.join("transforms.json")).unwrap()).unwrap();
    let cameras: Vec<Value> = document["frames"].as_array().unwrap().iter().step_by(2).cloned().collect();
    let (mut frames, mut train, mut test) = (Vec::new(), Vec::new(), Vec::new());
    for (number, camera) in cameras.iter().enumerate() {
        for i in 0..instants {
            let name = format!("images/cam{number:02}/{i:04}.png");
            if i > 1 {
                fs::hard_link(root.join("images/cam00/0000.png"), root.join(&name)).unwrap();
            }
            let mut frame = camera.clone();
            (frame["file_path"], frame["time"]) = (json!(name), json!(i as f64 / 30.0));
            frames.push(frame);
            if number == 0 { test.push(name) } else { train.push(name) }
        }
    }
    document["frames"] = json!(frames);
    (document["train_filenames"], document["test_filenames"]) = (json!(train), json!(test));
    document["fps"] = json!(30);
    fs::write(root.join("transforms.json"), document.to_string()).unwrap();
    let begin = std::time::Instant::now();
    let scene = Scene::open(&root, &LoadOptions::default()).unwrap();
    let seconds = begin.elapsed().as_secs_f64();
    eprintln!("{} frames opened in {seconds:.2} s", scene.train.len() + scene.test.len());
    assert_eq!((scene.train.len(), scene.test.len()), (5700, 300));
    assert!(seconds < 5.0, "{seconds} s");
    let begin = std::time::Instant::now();
    let part = scene.between(0.25, 0.5).unwrap();
    eprintln!("{} of them between 0.25 and 0.5 in {:.3} s", part.train.len(), begin.elapsed().as_secs_f64());
}

/// `LIGHT4GS_TAKE=FOLDER cargo test --release -p light4gs-data --lib a_take_to_look_at -- --ignored` writes the default take.
#[test]
#[ignore = "it writes a take of a minute to be looked at, where LIGHT4GS_TAKE says"]
fn a_take_to_look_at() {
    let Some(root) = std::env::var_os("LIGHT4GS_TAKE") else { return };
    let begin = std::time::Instant::now();
    let cameras = std::env::var("LIGHT4GS_TAKE_CAMERAS").map_or(1, |text| text.parse().unwrap());
    let seconds = std::env::var("LIGHT4GS_TAKE_SECONDS").map_or(60.0, |text| text.parse().unwrap());
    let options = TakeOptions { seconds, cameras, light: Some(0.75 * seconds), ..Default::default() };
    let cut = (cameras == 1).then_some(0.5 * seconds);
    write_take(root.as_ref(), &TakeOptions { cut, ..options }).unwrap();
    eprintln!("written in {:.1} s", begin.elapsed().as_secs_f64());
}
