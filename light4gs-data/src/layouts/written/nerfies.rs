//! The layouts `hypernerf` and `nerfds`: JSON files with distortion, skew and pixels that are not square.

use super::capture::{Capture, SIZE, Shot, opencv};
use super::*;
use crate::frame::MaskMeaning;
use crate::images::{Region, RgbImage8, regions};
use crate::lens::{Distortion, Lens};
use serde_json::{Value, json};
use std::fs;

/// The camera at twice the size of the images.
fn camera(shot: &Shot) -> Value {
    let c = shot.pinhole;
    let rows: Vec<[f32; 3]> = (0..3).map(|i| c.rotation.row(i).to_array()).collect();
    let (skew, radial, tangential) = match shot.lens {
        Some(Lens { skew, distortion: Distortion::RadialTangential { radial, tangential } }) => {
            (skew * f64::from(c.fx) * 2.0, radial, tangential)
        }
        _ => (0.0, [0.0; 6], [0.0; 2]),
    };
    json!({
        "orientation": rows,
        "position": c.center().to_array(),
        "focal_length": 2.0 * c.fx,
        "principal_point": [2.0 * c.cx, 2.0 * c.cy],
        "pixel_aspect_ratio": c.fy / c.fx,
        "skew": skew,
        "radial_distortion": radial[..3],
        "tangential_distortion": tangential,
        "image_size": [2 * SIZE.0, 2 * SIZE.1],
    })
}

pub(crate) fn write(root: &Path, capture: &Capture, val: &[usize]) {
    for folder in ["camera", "rgb/2x"] {
        fs::create_dir_all(root.join(folder)).unwrap();
    }
    let ids: Vec<&str> = capture.shots.iter().map(|shot| shot.name.as_str()).collect();
    let mut metadata = serde_json::Map::new();
    for (i, shot) in capture.shots.iter().enumerate() {
        let right = u8::from(shot.name.ends_with("_right"));
        let warp = (shot.time * 100.0).round();
        metadata.insert(shot.name.clone(), json!({"warp_id": warp, "appearance_id": i, "camera_id": right}));
        write_json(&root.join(format!("camera/{}.json", shot.name)), &camera(shot));
        capture.recorded(i).save_png(&root.join(format!("rgb/2x/{}.png", shot.name))).unwrap();
    }
    write_json(&root.join("metadata.json"), &Value::Object(metadata));
    let val_ids: Vec<&str> = val.iter().map(|i| ids[*i]).collect();
    let train_ids: Vec<&&str> = ids.iter().filter(|id| !val_ids.contains(id)).collect();
    let dataset = json!({"count": ids.len(), "ids": ids, "train_ids": train_ids, "val_ids": val_ids});
    write_json(&root.join("dataset.json"), &dataset);
    let points = [[0.5, 0.25, -0.5], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]].concat();
    fs::write(root.join("points.npy"), super::neu3d::npy(3, 3, &points)).unwrap();
}

fn write_json(path: &Path, value: &Value) {
    fs::write(path, value.to_string()).unwrap();
}

fn skewed() -> Lens {
    Lens { skew: 0.02, ..opencv() }
}

#[test]
fn hypernerf_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("", 5, Some(skewed()));
    write(folder.path(), &capture, &[1, 3]);
    let scene = check(folder.path(), "hypernerf", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.test.len(), scene.video.len()), (3, 2, 5));
    assert_eq!(times(&scene, Split::Test), [0.25, 0.75]);
    assert_eq!(scene.points.positions[0], [0.5, 0.25, -0.5]);
}

#[test]
fn times_begin_at_the_first_image() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("", 5, None);
    write(folder.path(), &capture, &[1, 3]);
    let path = folder.path().join("metadata.json");
    let mut metadata: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for entry in metadata.as_object_mut().unwrap().values_mut() {
        entry["warp_id"] = json!(entry["warp_id"].as_f64().unwrap() + 1000.0);
    }
    fs::write(path, metadata.to_string()).unwrap();
    let scene = Scene::open(folder.path(), &options()).unwrap();
    assert_eq!((times(&scene, Split::Train), times(&scene, Split::Test)), (vec![0.0, 0.5, 1.0], vec![0.25, 0.75]));
}

#[test]
fn nerfds_reads_back_with_cameras_and_masks() {
    let folder = tempfile::tempdir().unwrap();
    let plan = (0..3).flat_map(|i| {
        [("left", 0.0), ("right", 0.1)]
            .map(|(side, aside)| (format!("{i:06}_{side}"), 0.3 * i as f32 + aside, i as f32 / 2.0, Some(opencv())))
    });
    let capture = Capture::new(false, plan.collect());
    write(folder.path(), &capture, &[]);
    fs::create_dir_all(folder.path().join("mask/2x")).unwrap();
    let mask = RgbImage8 { width: SIZE.0, height: SIZE.1, pixels: vec![255; (SIZE.0 * SIZE.1 * 3) as usize] };
    mask.save_png(&folder.path().join("mask/2x/000001_left.png.png")).unwrap();
    let scene = check(folder.path(), "nerfds", &capture, by_name(&capture.shots));
    assert!(scene.train.iter().all(|frame| frame.camera_id == 0 && frame.name.ends_with("_left")));
    assert!(scene.test.iter().all(|frame| frame.camera_id == 1 && frame.name.ends_with("_right")));
    assert_eq!(times(&scene, Split::Train), [0.0, 0.5, 1.0]);
    let masked: Vec<bool> = scene.train.iter().map(|frame| frame.mask.is_some()).collect();
    assert_eq!(masked, [false, true, false]);
    assert_eq!(scene.train[1].mask.as_ref().unwrap().zero, MaskMeaning::Moving);
    // 255 everywhere: nothing moves, and all that the lens has recorded stands still.
    let found = regions(&scene.train[1]).unwrap();
    let count = |i: usize| found[i].1.pixels.iter().map(|v| usize::from(*v)).sum::<usize>();
    assert_eq!((found[0].0, count(0), found[1].0), (Region::Moving, 0, Region::Still));
    assert!(count(1) > found[1].1.pixels.len() / 2);
}

#[test]
fn missing_images_are_left_out_and_most_missing_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("", 6, None);
    write(folder.path(), &capture, &[1, 3]);
    let image = |i: usize| folder.path().join(format!("rgb/2x/{i:04}.png"));
    fs::rename(image(4), image(4).with_extension("PNG")).unwrap();
    fs::remove_file(image(5)).unwrap();
    let scene = Scene::open(folder.path(), &options()).unwrap();
    assert_eq!((scene.train.len(), scene.test.len()), (3, 2));
    assert!(scene.notes[0].contains("1 of the 6 images") && scene.notes[0].contains("0005.png"), "{:?}", scene.notes);
    for i in [0, 2, 1] {
        fs::remove_file(image(i)).unwrap();
    }
    let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
    assert!(message.contains("0000.png") && message.contains("4 of the 6"), "{message}");
}

#[test]
fn damaged_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("", 5, None);
    let root = folder.path();
    let refuses = |file: &str, change: &dyn Fn(&mut Value), words: &[&str]| {
        write(root, &capture, &[1, 3]);
        let path = root.join(file);
        let mut value: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
        change(&mut value);
        write_json(&path, &value);
        let message = Scene::open(root, &options()).unwrap_err().to_string();
        let name = file.rsplit('/').next().unwrap();
        for word in words.iter().chain(&[name, "; "]) {
            assert!(message.contains(word), "`{word}` is not in: {message}");
        }
    };
    fn remove(key: &str) -> impl Fn(&mut Value) + '_ {
        move |value| drop(value.as_object_mut().unwrap().remove(key))
    }
    fn set<'a>(key: &'a str, new: Value) -> impl Fn(&mut Value) + 'a {
        move |value| value[key] = new.clone()
    }
    let dataset = "dataset.json";
    refuses(dataset, &remove("ids"), &["ids", "missing"]);
    refuses(dataset, &set("ids", json!([])), &["ids", "at least one"]);
    refuses(dataset, &set("ids", json!([1, 2])), &["ids[0]", "a name"]);
    refuses(dataset, &set("ids", json!(["../../x"])), &["ids[0]", "leads out"]);
    refuses(dataset, &set("val_ids", json!(["nobody"])), &["val_ids[0]", "`nobody`"]);
    refuses("metadata.json", &remove("0002"), &["0002", "missing"]);
    refuses("metadata.json", &set("0002", json!({"camera_id": 0})), &["0002.warp_id", "missing"]);
    refuses("metadata.json", &set("0002", json!({"warp_id": -1})), &["0002.warp_id", "-1"]);
    refuses("metadata.json", &set("0002", json!({"warp_id": 1, "camera_id": 0.5})), &["0002.camera_id", "0.5"]);
    let camera = "camera/0003.json";
    for key in ["orientation", "position", "focal_length", "image_size"] {
        refuses(camera, &remove(key), &[key, "missing"]);
    }
    refuses(camera, &set("orientation", json!([[1, 0, 0], [0, 2, 0], [0, 0, 1]])), &["orientation", "not a rotation"]);
    refuses(camera, &set("orientation", json!([[1, 0, 0], [0, 1]])), &["orientation", "3 rows"]);
    refuses(camera, &set("position", json!([1, "x", 3])), &["position[1]", "x"]);
    refuses(camera, &set("focal_length", json!(-5)), &["focal lengths are -"]);
    refuses(camera, &set("image_size", json!([0, 10])), &["image_size", "0 x 10"]);
    refuses(camera, &set("image_size", json!([100, 200])), &["0003.png", "lies on its side"]);
    refuses(camera, &set("radial_distortion", json!([1, 2])), &["radial_distortion", "3 numbers"]);
    write(root, &capture, &[1]);
    fs::write(root.join("camera/0001.json"), "{\"orientation\": [[").unwrap();
    assert!(Scene::open(root, &options()).unwrap_err().to_string().contains("not valid JSON"));
    fs::remove_file(root.join("camera/0001.json")).unwrap();
    assert!(Scene::open(root, &options()).unwrap_err().to_string().contains("0001.json"));
    write(root, &capture, &[1]);
    fs::rename(root.join("rgb/2x"), root.join("rgb/3x")).unwrap();
    assert!(Scene::open(root, &options()).unwrap_err().to_string().contains("rgb/2x"));
}

#[test]
fn the_scale_with_most_images_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let capture = Capture::moving("", 4, None);
    write(root, &capture, &[1]);
    // As after a copy that was stopped, and images that were converted.
    fs::rename(root.join("rgb/2x"), root.join("rgb/4x")).unwrap();
    fs::create_dir(root.join("rgb/2x")).unwrap();
    fs::copy(root.join("rgb/4x/0000.png"), root.join("rgb/2x/0000.png")).unwrap();
    let jpeg = root.join("rgb/4x/0001.JPEG");
    image::open(root.join("rgb/4x/0001.png"))
        .unwrap()
        .into_rgb8()
        .save_with_format(&jpeg, image::ImageFormat::Jpeg)
        .unwrap();
    fs::remove_file(root.join("rgb/4x/0001.png")).unwrap();
    let scene = Scene::open(root, &options()).unwrap();
    assert_eq!((scene.train.len(), scene.test.len(), scene.notes.len()), (3, 1, 1), "{:?}", scene.notes);
    assert!(scene.train.iter().all(|frame| frame.path.starts_with(root.join("rgb/4x"))));
    assert_eq!(scene.test[0].path, jpeg);
}

#[test]
fn masks_of_another_scale_or_suffix_count_and_missing_ones_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let plan = (0..4).map(|i| (format!("{i:06}_{}", ["left", "right"][i % 2]), i as f32 / 4.0, i as f32 / 3.0, None));
    let capture = Capture::new(false, plan.collect());
    write(root, &capture, &[]);
    let mask = image::GrayImage::from_pixel(2 * SIZE.0, 2 * SIZE.1, image::Luma([255]));
    for name in ["mask/1x/000000_left.png.PNG", "mask/4x/000001_right.png", "mask/2x/000002_left.png.png"] {
        fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
        mask.save(root.join(name)).unwrap();
    }
    let scene = Scene::open(root, &options()).unwrap();
    assert!(scene.train.iter().all(|frame| frame.mask.is_some()));
    assert_eq!(scene.test.iter().filter(|frame| frame.mask.is_some()).count(), 1);
    let note = &scene.notes[0];
    assert!(note.contains("1 of the 4 images have no mask") && note.contains("000003_right.png"), "{note}");
}
