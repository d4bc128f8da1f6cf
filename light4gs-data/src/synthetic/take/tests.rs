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

/// `LIGHT4GS_TAKE=FOLDER cargo test --release -p light4gs-data --lib a_take_to_look_at -- --ignored` writes the default take.
#[test]
#[ignore = "it writes a take of a minute to be looked at, where LIGHT4GS_TAKE says"]
fn a_take_to_look_at() {
    let Some(root) = std::env::var_os("LIGHT4GS_TAKE") else { return };
    let begin = std::time::Instant::now();
    let cameras = std::env::var("LIGHT4GS_TAKE_CAMERAS").map_or(1, |text| text.parse().unwrap());
    let middle = (cameras == 1).then_some(30.0);
    write_take(root.as_ref(), &TakeOptions { cameras, cut: middle, light: Some(45.0), ..Default::default() }).unwrap();
    eprintln!("written in {:.1} s", begin.elapsed().as_secs_f64());
}
