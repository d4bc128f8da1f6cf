//! Every way in which a D-NeRF folder can be wrong gives an error that names file, field and remedy.

use light4gs_data::{
    DataError, DatasetDigest, Frame, ImageStore, LoadOptions, PointCloud, Region, Resolution, RgbImage8, Scene,
    ply::Encoding, regions,
};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn image(path: &Path, width: u32, height: u32) {
    let pixels = (0..width * height * 3).map(|i| (i * 37 % 251) as u8).collect();
    let image = RgbImage8 { width, height, pixels };
    image.save_png(path).unwrap();
}

fn transforms(split: &str, frames: usize) -> Value {
    let frames: Vec<Value> = (0..frames)
        .map(|i| {
            json!({
                "file_path": format!("./{split}/r_{i:03}"),
                "time": i as f64 * 0.5,
                "transform_matrix":
                    [[1, 0, 0, i], [0, 1, 0, 0.5], [0, 0, 1, 4], [0, 0, 0, 1]],
            })
        })
        .collect();
    json!({ "camera_angle_x": 0.7, "frames": frames })
}

/// A good scene: 5 training, 2 test, 2 validation frames of 32 × 24 pixels.
fn scene() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (split, count) in [("train", 5), ("test", 2), ("val", 2)] {
        fs::create_dir(folder.path().join(split)).unwrap();
        for i in 0..count {
            image(&folder.path().join(format!("{split}/r_{i:03}.png")), 32, 24);
        }
        write(folder.path(), split, &transforms(split, count));
    }
    folder
}

fn write(root: &Path, split: &str, value: &Value) {
    fs::write(root.join(format!("transforms_{split}.json")), value.to_string()).unwrap();
}

/// Opens the good scene after `change` to its training file; the error must contain all of `words`.
fn refuses(change: impl FnOnce(&mut Value), words: &[&str]) {
    let folder = scene();
    let mut value = transforms("train", 5);
    change(&mut value);
    write(folder.path(), "train", &value);
    expect(folder.path(), words);
}

fn expect(root: &Path, words: &[&str]) {
    let error = Scene::open(root, &LoadOptions::default()).unwrap_err().to_string();
    for word in words {
        assert!(error.contains(word), "`{word}` is not in: {error}");
    }
    assert!(error.contains("; "), "no remedy in: {error}");
}

#[test]
fn a_good_scene_opens() {
    let folder = scene();
    let options = LoadOptions { resolution: Resolution::MaxSide(16), ..Default::default() };
    let scene = Scene::open(folder.path(), &options).unwrap();
    assert_eq!((scene.train.len(), scene.test.len(), scene.val.len()), (5, 2, 2));
    let times: Vec<f32> = scene.train.iter().map(|f| f.time).collect();
    assert_eq!(times, [0.0, 0.25, 0.5, 0.75, 1.0]);
    let camera = scene.train[0].camera;
    assert_eq!((camera.width, camera.height, camera.cx, camera.cy), (16, 12, 8.0, 6.0));
    assert!((camera.fov().0 - 0.7).abs() < 1e-6 && (camera.fx - camera.fy).abs() < 1e-5);
    assert_eq!(camera.center().to_array(), [0.0, 0.5, 4.0]);
    // Centers are 0, 1, 2, 3, 4 along x.
    assert!((scene.extent - 2.2).abs() < 1e-6);
    let image = ImageStore::new(&options, 1 << 20).get(&scene.train[1]).unwrap();
    assert_eq!((image.width, image.height, image.pixels.len()), (16, 12, 576));
}

#[test]
fn val_may_be_absent_and_later_than_the_rest() {
    let folder = scene();
    let mut late = transforms("val", 2);
    late["frames"][1]["time"] = json!(7.0);
    write(folder.path(), "val", &late);
    let open = || Scene::open(folder.path(), &LoadOptions::default());
    assert_eq!(open().unwrap().val[1].time, 1.0);
    fs::remove_file(folder.path().join("transforms_val.json")).unwrap();
    assert!(open().unwrap().val.is_empty());
}

#[test]
fn points_beside_the_transforms_are_used() {
    let folder = scene();
    let cloud = PointCloud::random(17, 2.0, 1);
    for name in ["fused.ply", "points3d.ply"] {
        cloud.write_ply(&folder.path().join(name), Encoding::Ascii).unwrap();
        let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
        assert_eq!(scene.points.positions, cloud.positions);
    }
    fs::write(folder.path().join("points3d.ply"), "ply\nhm").unwrap();
    expect(folder.path(), &["points3d.ply"]);
}

#[test]
fn times() {
    let field = ["transforms_train.json", "frames[3].time"];
    let with = |word| [field[0], field[1], word];
    refuses(|v| drop(v["frames"][3].as_object_mut().unwrap().remove("time")), &with("missing"));
    refuses(|v| v["frames"][3]["time"] = json!("noon"), &with("noon"));
}

/// In milliseconds, in seconds since 1970, in nanoseconds since then, and in seconds from a moment in the middle.
#[test]
fn times_in_any_unit_give_the_same_scene() {
    for (unit, begin) in [(1000.0, 0.0), (1.0, 1.7643e9), (1e9, 1.7643e18), (1.0, -1.0)] {
        let folder = scene();
        for (split, count) in [("train", 5), ("test", 2), ("val", 2)] {
            let mut value = transforms(split, count);
            for (i, frame) in value["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
                frame["time"] = json!(begin + unit * 0.5 * i as f64);
            }
            write(folder.path(), split, &value);
        }
        let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
        let times = |frames: &[Frame]| frames.iter().map(|frame| frame.time).collect::<Vec<f32>>();
        assert_eq!(times(&scene.train), [0.0, 0.25, 0.5, 0.75, 1.0], "{unit} {begin}");
        assert_eq!((times(&scene.test), times(&scene.val)), (vec![0.0, 0.25], vec![0.0, 0.25]));
    }
}

#[test]
fn a_time_far_from_all_others_is_refused() {
    let words = ["transforms_train.json", "frames[].time", "of 5 different times", "in one unit"];
    refuses(|v| v["frames"][3]["time"] = json!(1e20), &words);
}

#[test]
fn splits_in_different_units_are_refused() {
    let folder = scene();
    let mut value = transforms("train", 5);
    for (i, frame) in value["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
        frame["time"] = json!(1000.0 * i as f64);
    }
    write(folder.path(), "train", &value);
    // Two times can be close by chance.
    assert!(Scene::open(folder.path(), &LoadOptions::default()).is_ok());
    let mut value = transforms("test", 2);
    let frames = value["frames"].as_array_mut().unwrap();
    frames.push(frames[0].clone());
    for (i, frame) in frames.iter_mut().enumerate() {
        frame["time"] = json!(0.5 * i as f64);
    }
    write(folder.path(), "test", &value);
    let words = ["transforms_test.json", "frames[].time", "from 0 to 1, those of", "from 0 to 4000", "in one unit"];
    expect(folder.path(), &words);
}

#[test]
fn frames_that_are_listed_twice_count_once() {
    let folder = scene();
    let mut value = transforms("train", 5);
    let copy = value["frames"][3].clone();
    value["frames"].as_array_mut().unwrap().push(copy);
    write(folder.path(), "train", &value);
    let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
    assert_eq!(scene.train.len(), 5);
    assert!(
        scene.notes[0].contains("transforms_train.json") && scene.notes[0].contains("1 entries"),
        "{:?}",
        scene.notes
    );
}

#[test]
fn many_frames_of_one_image_take_no_quadratic_time() {
    let folder = scene();
    let mut value = transforms("train", 5);
    let frames = (0..20_000).map(|i| {
        let mut frame = value["frames"][0].clone();
        frame["time"] = json!(i);
        frame
    });
    value["frames"] = frames.collect();
    write(folder.path(), "train", &value);
    let begun = std::time::Instant::now();
    let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
    assert_eq!((scene.train.len(), scene.train[19_999].name.as_str()), (20_000, "train_r_000_20000"));
    assert!(begun.elapsed().as_secs() < 20, "{:?}", begun.elapsed());
}

#[test]
fn a_point_far_away_is_left_out() {
    let folder = scene();
    let mut cloud = PointCloud::random(150, 1.3, 1);
    cloud.positions[7] = [0.0, 1e30, 0.0];
    cloud.write_ply(&folder.path().join("points3d.ply"), Encoding::BinaryLittleEndian).unwrap();
    let open = |options| Scene::open(folder.path(), &options).unwrap();
    let scene = open(LoadOptions::default());
    assert_eq!(scene.points.len(), 149);
    assert!(scene.notes[0].contains("1 of the 150 points"), "{:?}", scene.notes);
    let few = open(LoadOptions { most_points: 50, ..Default::default() });
    assert_eq!(few.points.len(), 50);
    assert!(few.notes[1].contains("of the 149 points, 50 are kept"), "{:?}", few.notes);
}

#[test]
fn poses() {
    let matrix = "frames[2].transform_matrix";
    let with = |word| ["transforms_train.json", matrix, word];
    let pose = |value: Value| move |v: &mut Value| v["frames"][2]["transform_matrix"] = value;
    refuses(|v| drop(v["frames"][2].as_object_mut().unwrap().remove("transform_matrix")), &with("missing"));
    let good = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]];
    refuses(pose(json!(good[..2])), &with("3 rows of 4"));
    refuses(pose(json!([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]])), &with("a list of 3"));
    refuses(pose(json!(7)), &with("3 rows of 4"));
    let scaled = [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 4], [0, 0, 0, 1]];
    refuses(pose(json!(scaled)), &with("not a rotation"));
    let zero = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 4], [0, 0, 0, 1]];
    refuses(pose(json!(zero)), &with("not a rotation"));
    let mirrored = [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]];
    refuses(pose(json!(mirrored)), &with("not a rotation"));
    let projective = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 1, 1]];
    refuses(pose(json!(projective)), &with("last row"));
    let huge = json!([[1e300, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]);
    refuses(pose(huge), &with("finite"));
}

#[test]
fn python_nan_and_infinity_in_a_pose() {
    for word in ["NaN", "Infinity", "-Infinity"] {
        let folder = scene();
        let mut value = transforms("train", 5);
        value["frames"][2]["transform_matrix"][1][3] = json!("HERE");
        let text = value.to_string().replace("\"HERE\"", word);
        fs::write(folder.path().join("transforms_train.json"), text).unwrap();
        expect(folder.path(), &["frames[2].transform_matrix[1][3]", word, "finite"]);
    }
}

#[test]
fn field_of_view() {
    let field = ["transforms_train.json", "camera_angle_x"];
    refuses(|v| drop(v.as_object_mut().unwrap().remove("camera_angle_x")), &field);
    for bad in [json!(0), json!(-0.7), json!(3.2), json!(40), json!(null), json!(1e-300)] {
        refuses(|v| v["camera_angle_x"] = bad, &field);
    }
}

#[test]
fn splits() {
    refuses(|v| v["frames"] = json!([]), &["transforms_train.json", "frames", "at least one"]);
    refuses(|v| *v = json!([1, 2]), &["transforms_train.json", "frames"]);
    let folder = scene();
    write(folder.path(), "val", &json!({ "camera_angle_x": 0.7, "frames": [] }));
    expect(folder.path(), &["transforms_val.json", "frames"]);
    fs::write(folder.path().join("transforms_train.json"), "{\"frames\": [").unwrap();
    expect(folder.path(), &["transforms_train.json", "JSON"]);
    fs::remove_file(folder.path().join("transforms_test.json")).unwrap();
    let folder = scene();
    fs::remove_file(folder.path().join("transforms_test.json")).unwrap();
    let error = Scene::open(folder.path(), &LoadOptions::default()).unwrap_err();
    assert!(matches!(&error, DataError::Io { path, .. } if path.ends_with("transforms_test.json")));
}

#[test]
fn images() {
    let named = ["r_004.png", "frames[4].file_path"];
    let folder = scene();
    fs::remove_file(folder.path().join("train/r_004.png")).unwrap();
    expect(folder.path(), &named);
    refuses(|v| drop(v["frames"][4].as_object_mut().unwrap().remove("file_path")), &["frames[4].file_path", "missing"]);
    // A name with an extension is found as well.
    let folder = scene();
    let mut value = transforms("train", 5);
    value["frames"][4]["file_path"] = json!("train/r_004.png");
    write(folder.path(), "train", &value);
    let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
    assert_eq!(scene.train[4].name, "r_004");
    // Damage that shows in headers and ends of files is found on opening; other damage is found when the image is
    // decoded.
    let store = ImageStore::new(&LoadOptions::default(), 1 << 20);
    let path = &scene.train[2].path;
    let bytes = fs::read(path).unwrap();
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2] ^= 0x55;
    fs::write(path, &damaged).unwrap();
    assert!(Scene::open(folder.path(), &LoadOptions::default()).is_ok());
    let message = store.get(&scene.train[2]).unwrap_err().to_string();
    assert!(message.contains("r_002.png") && message.contains("damaged"), "{message}");
    fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
    expect(folder.path(), &["r_002.png", "truncated"]);
    image(path, 31, 24);
    expect(folder.path(), &["r_002.png", "31 x 24 pixels, expected 32 x 24"]);
    let changed = store.get(&scene.train[2]).unwrap_err().to_string();
    assert!(changed.contains("31 x 24 pixels, expected 32 x 24"), "{changed}");
    fs::write(&scene.train[2].path, &bytes[..10]).unwrap();
    expect(folder.path(), &["r_002.png", "header"]);
}

#[test]
fn paths_that_leave_the_folder() {
    for path in ["../secret.png", "/etc/passwd", "train/../../x"] {
        refuses(|v| v["frames"][1]["file_path"] = json!(path), &["frames[1].file_path", "leads out"]);
    }
}

#[cfg(unix)]
#[test]
fn folders_whose_names_are_not_utf_8() {
    use std::os::unix::ffi::OsStrExt;
    let folder = scene();
    let odd = folder.path().with_file_name(std::ffi::OsStr::from_bytes(b"light4gs-\xff-name"));
    let _ = fs::remove_dir_all(&odd);
    fs::rename(folder.path(), &odd).unwrap();
    let opened = Scene::open(&odd, &LoadOptions::default());
    fs::rename(&odd, folder.path()).unwrap();
    assert_eq!(opened.unwrap().name, "light4gs-\u{fffd}-name");
}

/// Masks for the images of a split, at their size, in which the pixel in the corner moves.
fn masks(root: &Path, split: &str, count: usize) {
    fs::create_dir_all(root.join("mask").join(split)).unwrap();
    for i in 0..count {
        let corner = |x, y| image::Luma([if (x, y) == (0, 0) { 255 } else { 0 }]);
        image::GrayImage::from_fn(32, 24, corner).save(root.join(format!("mask/{split}/r_{i:03}.png"))).unwrap();
    }
}

#[test]
fn masks_of_what_moves() {
    let folder = scene();
    let options = LoadOptions { resolution: Resolution::MaxSide(16), ..Default::default() };
    let open = || Scene::open(folder.path(), &options).unwrap();
    let before = DatasetDigest::of(&open()).unwrap();
    masks(folder.path(), "test", 2);
    let scene = open();
    let masked = |frames: &[light4gs_data::Frame]| frames.iter().filter(|frame| frame.mask.is_some()).count();
    assert_eq!((masked(&scene.train), masked(&scene.test), masked(&scene.val)), (0, 2, 0));
    let found = regions(&scene.test[1]).unwrap();
    let count = |i: usize| found[i].1.pixels.iter().map(|v| usize::from(*v)).sum::<usize>();
    assert_eq!((found[0].0, count(0), found[0].1.pixels[0]), (Region::Moving, 1, 1));
    assert_eq!((found[1].0, count(1)), (Region::Still, 16 * 12 - 1));
    assert!(regions(&scene.train[0]).unwrap().is_empty());
    assert_eq!(DatasetDigest::of(&scene).unwrap().changes_since(&before).len(), 1);
}

#[test]
fn bad_masks_are_refused() {
    let folder = scene();
    masks(folder.path(), "test", 2);
    let path = folder.path().join("mask/test/r_001.png");
    let good = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    expect(folder.path(), &["mask/test/r_001.png", "missing", "1 of the 2 images"]);
    image(&path, 24, 32);
    expect(folder.path(), &["mask/test/r_001.png", "24 x 32", "32 x 24"]);
    fs::write(&path, &good[..good.len() - 5]).unwrap();
    expect(folder.path(), &["mask/test/r_001.png", "truncated"]);
    fs::write(&path, "no image").unwrap();
    expect(folder.path(), &["mask/test/r_001.png", "header"]);
    // Sound at its ends, damaged between: said when it is read.
    let mut damaged = good;
    let middle = damaged.windows(4).position(|name| name == b"IDAT").unwrap() + 6;
    damaged[middle..middle + 6].fill(0x55);
    fs::write(&path, damaged).unwrap();
    let scene = Scene::open(folder.path(), &LoadOptions::default()).unwrap();
    let message = regions(&scene.test[1]).unwrap_err().to_string();
    assert!(message.contains("mask/test/r_001.png") && message.contains("damaged"), "{message}");
}
