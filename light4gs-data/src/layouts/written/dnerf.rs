//! The layout `dnerf` with intrinsics and lenses that Blender does not write: the fields are those of nerfstudio.

use super::capture::{Capture, fisheye, opencv};
use super::nerfstudio::{intrinsics, write_images};
use super::*;
use serde_json::{Value, json};
use std::fs;

/// Writes the shots: even ones to train on, odd ones to test, with intrinsics at the top of the files or in every frame.
pub(crate) fn write(root: &Path, capture: &Capture, shared: bool) {
    write_images(root, capture);
    for (split, first) in [("train", 0), ("test", 1)] {
        let mut top = if shared { intrinsics(&capture.shots[0]) } else { json!({}) };
        let shots = capture.shots.iter().skip(first).step_by(2);
        let frames: Vec<Value> = shots
            .map(|shot| {
                let mut frame = if shared { json!({}) } else { intrinsics(shot) };
                frame["file_path"] = json!(format!("./images/{}", shot.name));
                frame["transform_matrix"] = json!(shot.pinhole.camera_to_world_opengl());
                frame["time"] = json!(shot.time);
                frame
            })
            .collect();
        top["frames"] = json!(frames);
        fs::write(root.join(format!("transforms_{split}.json")), top.to_string()).unwrap();
    }
}

#[test]
fn intrinsics_and_lenses_are_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("r_", 6, Some(opencv()));
    write(folder.path(), &capture, true);
    let scene = check(folder.path(), "dnerf", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.test.len()), (3, 3));
    assert_eq!(times(&scene, Split::Train), [0.0, 0.4, 0.8]);
}

#[test]
fn intrinsics_and_lenses_may_differ_from_frame_to_frame() {
    let folder = tempfile::tempdir().unwrap();
    let plan = (0..6).map(|i| {
        let lens = [None, Some(opencv()), Some(fisheye())][i / 2];
        (format!("x{i}"), i as f32 / 5.0, i as f32 / 5.0, lens)
    });
    let capture = Capture::new(false, plan.collect());
    write(folder.path(), &capture, false);
    check(folder.path(), "dnerf", &capture, by_name(&capture.shots));
}

#[test]
fn an_angle_of_view_of_its_own_is_that_of_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::new(true, (0..4).map(|i| (format!("x{i}"), i as f32 / 3.0, i as f32 / 3.0, None)).collect());
    write(folder.path(), &capture, true);
    for split in ["train", "test"] {
        let path = folder.path().join(format!("transforms_{split}.json"));
        let mut document: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        for key in ["fl_x", "fl_y", "cx", "cy", "w", "h"] {
            document.as_object_mut().unwrap().remove(key);
        }
        document["camera_angle_x"] = json!(0.4);
        for frame in document["frames"].as_array_mut().unwrap() {
            frame["camera_angle_x"] = json!(capture.shots[0].pinhole.fov().0);
        }
        fs::write(path, document.to_string()).unwrap();
    }
    check(folder.path(), "dnerf", &capture, by_name(&capture.shots));
}
