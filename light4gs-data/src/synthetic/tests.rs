//! The quickstart's scene as it is written.

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

/// Recorded runs name the scene by its options alone. Sines differ between systems, and with them bytes.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn its_bytes_stay_the_same_from_version_to_version() {
    use sha2::{Digest, Sha256};
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("scene");
    write_synthetic(&root, &small(3)).unwrap();
    let mut hash = Sha256::new();
    for (path, bytes) in contents(&root) {
        hash.update(path.strip_prefix(&root).unwrap().to_str().unwrap());
        hash.update(bytes);
    }
    let found: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(found, "4c7f84f0d96ee9a2f25000bff6c155510d5d0c57b80018785a3dbb24ddb77e13");
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
