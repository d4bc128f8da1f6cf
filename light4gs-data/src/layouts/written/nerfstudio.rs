//! The layout `nerfstudio`: shared and own intrinsics, both lenses, times, splits, masks.

use super::capture::{Capture, SIZE, Shot, fisheye, opencv};
use super::*;
use crate::lens::Distortion;
use serde_json::{Value, json};
use std::fs;

pub(crate) fn intrinsics(shot: &Shot) -> Value {
    let c = shot.pinhole;
    let mut value = json!({"fl_x": c.fx, "fl_y": c.fy, "cx": c.cx, "cy": c.cy, "w": SIZE.0, "h": SIZE.1});
    match shot.lens.map(|lens| lens.distortion) {
        Some(Distortion::Fisheye { radial }) => {
            value["camera_model"] = json!("OPENCV_FISHEYE");
            for (i, k) in radial.iter().enumerate() {
                value[format!("k{}", i + 1)] = json!(k);
            }
        }
        Some(Distortion::RadialTangential { radial, tangential }) => {
            value["camera_model"] = json!("OPENCV");
            (value["k1"], value["k2"]) = (json!(radial[0]), json!(radial[1]));
            (value["p1"], value["p2"]) = (json!(tangential[0]), json!(tangential[1]));
        }
        _ => {}
    }
    value
}

/// The document with intrinsics at the top, or in every frame.
pub(crate) fn document(capture: &Capture, shared: bool) -> Value {
    let mut top = if shared { intrinsics(&capture.shots[0]) } else { json!({}) };
    let frames: Vec<Value> = capture
        .shots
        .iter()
        .map(|shot| {
            let mut frame = if shared { json!({}) } else { intrinsics(shot) };
            frame["file_path"] = json!(format!("images/{}.png", shot.name));
            frame["transform_matrix"] = json!(shot.pinhole.camera_to_world_opengl());
            frame
        })
        .collect();
    top["frames"] = json!(frames);
    top
}

/// Writes the images that are not there yet.
pub(crate) fn write_images(root: &Path, capture: &Capture) {
    fs::create_dir_all(root.join("images")).unwrap();
    for (i, shot) in capture.shots.iter().enumerate() {
        let path = root.join(format!("images/{}.png", shot.name));
        if !path.exists() {
            capture.recorded(i).save_png(&path).unwrap();
        }
    }
}

pub(crate) fn write(root: &Path, capture: &Capture, document: &Value) {
    write_images(root, capture);
    fs::write(root.join("transforms.json"), document.to_string()).unwrap();
}

#[test]
fn shared_intrinsics_and_names_that_count() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 6, Some(opencv()));
    write(folder.path(), &capture, &document(&capture, true));
    let scene = check(folder.path(), "nerfstudio", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.test.len()), (5, 1));
    assert_eq!(scene.test[0].name, "frame_0003");
    assert_eq!(times(&scene, Split::Train), [0.0, 0.2, 0.4, 0.8, 1.0]);
}

#[test]
fn own_intrinsics_times_and_splits() {
    let folder = tempfile::tempdir().unwrap();
    let plan = (0..6).map(|i| {
        let lens = [None, Some(opencv()), Some(fisheye())][i % 3];
        (format!("x{i}"), i as f32 / 5.0, i as f32 / 10.0, lens)
    });
    let capture = Capture::new(false, plan.collect());
    let mut document = document(&capture, false);
    for (i, shot) in capture.shots.iter().enumerate() {
        document["frames"][i]["time"] = json!(shot.time);
    }
    document["train_filenames"] = json!(["images/x0.png", "images/x1.png", "images/x2.png", "images/x5.png"]);
    document["val_filenames"] = json!(["images/x3.png"]);
    document["test_filenames"] = json!(["./images/x4.png"]);
    document["frames"][1]["mask_path"] = json!("masks/x1.png");
    fs::create_dir(folder.path().join("masks")).unwrap();
    image::GrayImage::from_pixel(SIZE.0, SIZE.1, image::Luma([255])).save(folder.path().join("masks/x1.png")).unwrap();
    write(folder.path(), &capture, &document);
    let scene = check(folder.path(), "nerfstudio", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.val.len(), scene.test.len()), (4, 1, 1));
    assert_eq!(times(&scene, Split::Train), [0.0, 0.1, 0.2, 0.5]);
    assert!(scene.train[1].mask.is_some() && scene.train[0].mask.is_none());
    // Times in seconds or frames are mapped to [0, 1].
    for i in 0..6 {
        document["frames"][i]["time"] = json!(100 + i);
    }
    write(folder.path(), &capture, &document);
    assert_eq!(times(&Scene::open(folder.path(), &options()).unwrap(), Split::Train), [0.0, 0.2, 0.4, 1.0]);
}

#[test]
fn seconds_follow_from_a_rate_and_times_in_any_unit() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 6, None);
    let seconds = |change: &dyn Fn(&mut Value)| {
        let mut document = document(&capture, true);
        change(&mut document);
        write(folder.path(), &capture, &document);
        let scene = Scene::open(folder.path(), &options()).unwrap();
        (scene.seconds.map(|seconds| (1e6 * seconds).round() / 1e6), scene.notes.join("\n"))
    };
    let timed = |time: fn(i32) -> f64| {
        move |v: &mut Value| {
            v["fps"] = json!(5);
            for i in 0..6 {
                v["frames"][i as usize]["time"] = json!(time(i));
            }
        }
    };
    let found = |change: &dyn Fn(&mut Value)| seconds(change).0;
    assert_eq!(found(&|_| ()), None);
    // Numbers in names; seconds of a short and of a longer part; numbers of frames, from any on; shares.
    assert_eq!(found(&|v| v["fps"] = json!(5)), Some(1.0));
    assert_eq!(found(&timed(|i| 0.2 * f64::from(i))), Some(1.0));
    assert_eq!(found(&timed(|i| 7.0 + 0.2 * f64::from(i))), Some(1.0));
    assert_eq!(found(&timed(|i| f64::from(100 + i))), Some(1.0));
    assert_eq!(found(&timed(|i| f64::from(i) / 10.0)), Some(2.0));
    // Seconds, where frames were left out.
    assert_eq!(found(&timed(|i| 0.4 * f64::from(i * i))), Some(10.0));
    let gap = |v: &mut Value| {
        v["fps"] = json!(10.0);
        v["frames"].as_array_mut().unwrap().remove(2);
    };
    assert_eq!(found(&gap), Some(0.5));
    assert_eq!(found(&|v| v["seconds"] = json!(12.5)), Some(12.5));
    for bad in [json!(0), json!(-30), json!("30"), json!([30])] {
        let (found, notes) = seconds(&|v| v["fps"] = bad.clone());
        assert!(found.is_none() && notes.contains("fps is") && notes.contains("no positive number"), "{notes}");
    }
    assert_eq!(seconds(&|v| v["fps"] = json!(null)), (None, String::new()));
}

#[test]
fn damaged_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 3, None);
    let refuses = |change: &dyn Fn(&mut Value), words: &[&str]| {
        let mut document = document(&capture, true);
        change(&mut document);
        write(folder.path(), &capture, &document);
        let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
        for word in words.iter().chain(&["; "]) {
            assert!(message.contains(word), "`{word}` is not in: {message}");
        }
    };
    let file = "transforms.json";
    refuses(&|v| drop(v.as_object_mut().unwrap().remove("frames")), &[file, "frames", "missing"]);
    refuses(&|v| v["frames"] = json!([]), &[file, "frames", "at least one"]);
    let without = |v: &mut Value| ["fl_x", "fl_y"].iter().for_each(|key| drop(v.as_object_mut().unwrap().remove(*key)));
    refuses(&without, &[file, "fl_x", "camera_angle_x"]);
    refuses(&|v| v["camera_model"] = json!("EQUIRECTANGULAR"), &[file, "camera_model", "EQUIRECTANGULAR"]);
    refuses(&|v| v["fl_x"] = json!("wide"), &[file, "fl_x", "wide"]);
    refuses(&|v| v["fl_x"] = json!(0), &[file, "focal lengths are 0"]);
    refuses(&|v| v["w"] = json!(-4), &[file, "w", "-4"]);
    refuses(&|v| (v["w"], v["h"]) = (json!(50), json!(100)), &["frame_0000.png", "lies on its side"]);
    refuses(&|v| v["k1"] = json!(null), &[file, "k1"]);
    // Cropped after the poses were estimated.
    refuses(&|v| v["h"] = json!(SIZE.1 + 20), &["frame_0000.png", "97 x 74", "97 x 94", "cropped"]);
    refuses(&|v| v["frames"][1]["transform_matrix"][3][0] = json!(2), &["frames[1].transform_matrix[3]", "last row"]);
    refuses(&|v| v["frames"][1]["transform_matrix"] = json!([[1, 0], [0, 1]]), &["frames[1].transform_matrix"]);
    refuses(&|v| v["frames"][1]["transform_matrix"][0][0] = json!(7), &["frames[1].transform_matrix", "rotation"]);
    refuses(&|v| v["frames"][1]["file_path"] = json!("/etc/passwd"), &["frames[1].file_path", "leads out"]);
    refuses(&|v| drop(v["frames"][1].as_object_mut().unwrap().remove("file_path")), &["frames[1].file_path"]);
    refuses(&|v| v["frames"][1]["time"] = json!(0.5), &["frames[0].time", "missing"]);
    refuses(&|v| v["test_filenames"] = json!(["x.png", "y.png"]), &[file, "test_filenames", "2 names", "`x.png`"]);
    refuses(&|v| v["test_filenames"] = json!("x"), &["test_filenames", "a list of names"]);
    refuses(&|v| v["ply_file_path"] = json!("../x.ply"), &["ply_file_path", "leads out"]);
}

#[test]
fn the_fourth_coefficient_continues_the_polynomial() {
    let folder = tempfile::tempdir().unwrap();
    let lens = Distortion::BrownConrady { radial: [-0.1, 0.05, 0.02, 0.4], tangential: [0.001, -0.002] };
    let capture = Capture::moving("frame_", 2, crate::lens::Lens::new(lens, 0.0));
    let mut document = document(&capture, true);
    for (key, value) in [("k1", -0.1), ("k2", 0.05), ("k3", 0.02), ("k4", 0.4), ("p1", 0.001), ("p2", -0.002)] {
        document[key] = json!(value);
    }
    for model in [json!("OPENCV"), json!("opencv"), json!(null)] {
        document["camera_model"] = model;
        write(folder.path(), &capture, &document);
        let scene = check(folder.path(), "nerfstudio", &capture, by_name(&capture.shots));
        assert_eq!(scene.train[0].lens.unwrap().distortion, lens);
    }
    // In OpenCV's own model it is in the denominator.
    document["camera_model"] = json!("FULL_OPENCV");
    write(folder.path(), &capture, &document);
    let scene = Scene::open(folder.path(), &options()).unwrap();
    assert!(matches!(scene.train[0].lens.unwrap().distortion, Distortion::RadialTangential { .. }));
}

#[test]
fn frames_that_are_listed_twice_count_once() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 6, None);
    let mut document = document(&capture, true);
    let copy = document["frames"][2].clone();
    document["frames"].as_array_mut().unwrap().insert(4, copy);
    write(folder.path(), &capture, &document);
    let scene = check(folder.path(), "nerfstudio", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.test.len()), (5, 1));
    assert_eq!(times(&scene, Split::Train), [0.0, 0.2, 0.4, 0.8, 1.0]);
    let note = &scene.notes[0];
    assert!(note.contains("1 entries") && note.contains("second time") && note.contains("frame_0002.png"), "{note}");
}

#[test]
fn still_scenes_and_single_images() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::new(false, (0..12).map(|i| (format!("x{i}"), i as f32 / 11.0, 0.0, None)).collect());
    let mut document = document(&capture, true);
    for i in 0..12 {
        document["frames"][i]["time"] = json!(3.5);
    }
    write(folder.path(), &capture, &document);
    let scene = check(folder.path(), "nerfstudio", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.test.len()), (11, 1));
    assert_eq!(times(&scene, Split::Train), [0.0]);
    document["frames"].as_array_mut().unwrap().truncate(1);
    write(folder.path(), &capture, &document);
    let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
    assert!(message.contains("1 image found, expected at least 2"), "{message}");
}

#[test]
fn names_in_another_form_of_unicode_and_absolute_paths_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let capture =
        Capture::new(false, (0..4).map(|i| (format!("zo\u{eb}_{i}"), i as f32 / 3.0, i as f32 / 3.0, None)).collect());
    let mut document = document(&capture, true);
    let absolute = folder.path().join("images/zo\u{eb}_1.png");
    document["frames"][0]["file_path"] = json!("Images/zoe\u{308}_0.PNG");
    document["frames"][1]["file_path"] = json!(absolute);
    let name = folder.path().file_name().unwrap().to_str().unwrap();
    document["frames"][2]["file_path"] = json!(format!("../{name}/images/zo\u{eb}_2.png"));
    write(folder.path(), &capture, &document);
    check(folder.path(), "nerfstudio", &capture, by_name(&capture.shots));
}

#[test]
fn what_is_left_out_or_ignored_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 9, None);
    let notes = |change: &dyn Fn(&mut Value)| {
        let mut document = document(&capture, true);
        change(&mut document);
        write(folder.path(), &capture, &document);
        Scene::open(folder.path(), &options()).unwrap().notes.join("\n")
    };
    assert_eq!(notes(&|_| ()), "");
    let missing = notes(&|v| v["ply_file_path"] = json!("no.ply"));
    assert!(missing.contains("no.ply") && missing.contains("ply_file_path"), "{missing}");
    let all: Vec<String> = capture.shots.iter().map(|shot| format!("images/{}.png", shot.name)).collect();
    let held_out = notes(&|v| (v["train_filenames"], v["test_filenames"]) = (json!(all), json!([])));
    assert!(held_out.contains("1 of its 9 images are held out"), "{held_out}");
    let unposed = notes(&|v| drop(v["frames"].as_array_mut().unwrap().pop()));
    assert!(unposed.contains("1 of the 9 images") && unposed.contains("no pose"), "{unposed}");
}

#[test]
fn masks_that_are_missing_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 3, None);
    let mut document = document(&capture, true);
    for i in 0..3 {
        document["frames"][i]["mask_path"] = json!(format!("masks/{i}.png"));
    }
    write(folder.path(), &capture, &document);
    fs::create_dir(folder.path().join("masks")).unwrap();
    let mask = image::GrayImage::from_pixel(SIZE.0, SIZE.1, image::Luma([255]));
    for name in ["0.PNG", "2.png"] {
        mask.save(folder.path().join("masks").join(name)).unwrap();
    }
    let scene = Scene::open(folder.path(), &options()).unwrap();
    let note = &scene.notes[0];
    assert!(note.contains("1 of the 3 images have no mask") && note.contains("frame_0001.png"), "{note}");
    // A mask of another shape is refused.
    image::GrayImage::new(SIZE.0, SIZE.1 / 2).save(folder.path().join("masks/1.png")).unwrap();
    let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
    assert!(message.contains("masks/1.png") && message.contains("97 x 37") && message.contains("97 x 74"), "{message}");
}
