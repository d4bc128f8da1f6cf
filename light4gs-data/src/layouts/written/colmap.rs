//! The layout `colmap`, binary and text, one moving camera and a rig.

use super::capture::{Capture, SIZE, Shot, fisheye, opencv};
use super::*;
use crate::lens::Distortion;
use glam::Quat;
use std::fmt::Write;
use std::fs;

/// COLMAP's model: number, name, parameters.
fn parameters(shot: &Shot) -> (u32, &'static str, Vec<f64>) {
    let c = shot.pinhole;
    let mut values: Vec<f64> = [c.fx, c.fy, c.cx, c.cy].map(f64::from).into();
    match shot.lens.map(|lens| lens.distortion) {
        None => (1, "PINHOLE", values),
        Some(Distortion::Fisheye { radial }) => {
            values.extend(radial);
            (5, "OPENCV_FISHEYE", values)
        }
        Some(Distortion::RadialTangential { radial, tangential }) => {
            values.extend([radial[0], radial[1], tangential[0], tangential[1]]);
            (4, "OPENCV", values)
        }
        Some(other) => panic!("{other:?} is not written"),
    }
}

fn pose(shot: &Shot) -> [f64; 7] {
    let q = Quat::from_mat3(&shot.pinhole.rotation);
    let t = shot.pinhole.translation;
    [q.w, q.x, q.y, q.z, t.x, t.y, t.z].map(f64::from)
}

pub(crate) fn write_images(root: &Path, capture: &Capture) {
    for (i, shot) in capture.shots.iter().enumerate() {
        let path = root.join(format!("images/{}.png", shot.name));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        capture.recorded(i).save_png(&path).unwrap();
    }
    fs::create_dir_all(root.join("sparse/0")).unwrap();
}

pub(crate) fn write_text(root: &Path, capture: &Capture) {
    let (mut cameras, mut images) = ("# cameras\n".to_owned(), "# images\n".to_owned());
    for (i, shot) in capture.shots.iter().enumerate() {
        let (_, model, values) = parameters(shot);
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        writeln!(cameras, "{i} {model} {} {} {}", SIZE.0, SIZE.1, values.join(" ")).unwrap();
        let values: Vec<String> = pose(shot).iter().map(f64::to_string).collect();
        // Images without keypoints have an empty line.
        let keypoints = if i % 2 == 0 { "" } else { "1.5 2.5 -1" };
        writeln!(images, "{} {} {i} {}.png\n{keypoints}", i + 1, values.join(" "), shot.name).unwrap();
    }
    let model = root.join("sparse/0");
    fs::write(model.join("cameras.txt"), cameras).unwrap();
    fs::write(model.join("images.txt"), images).unwrap();
    fs::write(model.join("points3D.txt"), "# points\n7 0.5 0.25 -0.5 255 0 51 0.75 1 0 2 0\n8 1 0 0 0 0 0 0.25\n")
        .unwrap();
}

pub(crate) fn write_binary(root: &Path, capture: &Capture) {
    let count = (capture.shots.len() as u64).to_le_bytes();
    let (mut cameras, mut images) = (count.to_vec(), count.to_vec());
    let floats = |values: &[f64]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    for (i, shot) in capture.shots.iter().enumerate() {
        let (number, _, values) = parameters(shot);
        cameras.extend((i as u32).to_le_bytes());
        cameras.extend(number.to_le_bytes());
        cameras.extend(u64::from(SIZE.0).to_le_bytes());
        cameras.extend(u64::from(SIZE.1).to_le_bytes());
        cameras.extend(floats(&values));
        images.extend((i as u32 + 1).to_le_bytes());
        images.extend(floats(&pose(shot)));
        images.extend((i as u32).to_le_bytes());
        images.extend(format!("{}.png\0", shot.name).as_bytes());
        images.extend(1u64.to_le_bytes());
        images.extend(floats(&[1.5, 2.5]));
        images.extend((-1i64).to_le_bytes());
    }
    let mut points = 2u64.to_le_bytes().to_vec();
    for (position, color, error) in [([0.5, 0.25, -0.5], [255u8, 0, 51], 0.75), ([1.0, 0.0, 0.0], [0; 3], 0.25)] {
        points.extend(7u64.to_le_bytes());
        points.extend(floats(&position));
        points.extend(color);
        points.extend(floats(&[error]));
        points.extend(1u64.to_le_bytes());
        points.extend([0; 8]);
    }
    let model = root.join("sparse/0");
    fs::write(model.join("cameras.bin"), cameras).unwrap();
    fs::write(model.join("images.bin"), images).unwrap();
    fs::write(model.join("points3D.bin"), points).unwrap();
}

#[test]
fn a_moving_camera_reads_back_in_both_formats() {
    for (lens, write) in [(Some(opencv()), write_text as fn(&Path, &Capture)), (Some(fisheye()), write_binary)] {
        let folder = tempfile::tempdir().unwrap();
        let capture = Capture::moving("frame_", 9, lens);
        write_images(folder.path(), &capture);
        write(folder.path(), &capture);
        let scene = check(folder.path(), "colmap", &capture, by_name(&capture.shots));
        assert_eq!((scene.train.len(), scene.test.len()), (8, 1));
        assert_eq!((scene.test[0].name.as_str(), scene.test[0].time), ("frame_0004", 0.5));
        assert_eq!(scene.train[8 - 1].time, 1.0);
        assert_eq!(scene.points.positions, [[0.5, 0.25, -0.5], [1.0, 0.0, 0.0]]);
        assert_eq!(scene.points.colors[0], [1.0, 0.0, 0.2]);
        let model = crate::layouts::colmap::read_model(&folder.path().join("sparse/0")).unwrap();
        assert_eq!(model.error, Some(0.5));
    }
}

#[test]
fn a_rig_of_folders_reads_back_and_strays_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let plan =
        (0..4).flat_map(|c| (0..2).map(move |i| (format!("cam{c}/{:04}", i + 1), c as f32 / 3.0, i as f32, None)));
    let capture = Capture::new(false, plan.collect());
    write_images(folder.path(), &capture);
    write_binary(folder.path(), &capture);
    // Two images that COLMAP could not pose.
    for name in ["cam0/0003.png", "cam1/0003.png"] {
        fs::copy(folder.path().join("images/cam0/0001.png"), folder.path().join("images").join(name)).unwrap();
    }
    let by_frame = |name: &str| capture.shots.iter().position(|shot| shot.name.replace('/', "_") == name);
    let scene = check(folder.path(), "colmap", &capture, by_frame);
    assert_eq!((scene.train.len(), scene.test.len()), (6, 2));
    assert!(scene.test.iter().all(|frame| frame.camera_id == 0));
    assert_eq!(times(&scene, Split::Train), [0.0, 1.0]);
    assert!(scene.notes[0].contains("2 of the 10 images"), "{:?}", scene.notes);
}

fn refuses(root: &Path, words: &[&str]) {
    let message = Scene::open(root, &options()).unwrap_err().to_string();
    for word in words.iter().chain(&["; "]) {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
}

#[test]
fn every_truncation_of_a_binary_file_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 2, Some(opencv()));
    write_images(folder.path(), &capture);
    write_binary(folder.path(), &capture);
    for name in ["cameras.bin", "images.bin", "points3D.bin"] {
        let path = folder.path().join("sparse/0").join(name);
        let whole = fs::read(&path).unwrap();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            refuses(folder.path(), &[name]);
        }
        fs::write(&path, [&whole[..], b"x"].concat()).unwrap();
        refuses(folder.path(), &[name, "1 bytes follow"]);
        // For a count that the file cannot hold, no memory is allocated.
        fs::write(&path, [&u64::MAX.to_le_bytes(), &whole[8..]].concat()).unwrap();
        refuses(folder.path(), &[name, "18446744073709551615"]);
        fs::write(&path, whole).unwrap();
    }
    assert!(Scene::open(folder.path(), &options()).is_ok());
}

#[test]
fn damaged_models_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let capture = Capture::moving("frame_", 2, Some(opencv()));
    write_images(root, &capture);
    let changed = |file: &str, from: &str, to: &str, words: &[&str]| {
        write_text(root, &capture);
        let path = root.join("sparse/0").join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        refuses(root, &[words, &[file]].concat());
    };
    changed("cameras.txt", "OPENCV", "PANORAMA", &["line 2", "`PANORAMA`", "OPENCV_FISHEYE", "image_undistorter"]);
    changed("cameras.txt", "OPENCV", "PINHOLE", &["line 2", "8 parameters, expected 4"]);
    changed("cameras.txt", "97 74", "97 x", &["line 2", "`x`", "a height"]);
    changed("cameras.txt", "97 74", "0 74", &["line 2", "0 x 74"]);
    changed("cameras.txt", "0 OPENCV 97", "0 OPENCV", &["line 2"]);
    changed("images.txt", "frame_0000.png", "", &["line 2", "IMAGE_ID QW"]);
    changed("images.txt", " 0 frame_0000", " 17 frame_0000", &["image `frame_0000.png` is of camera 17"]);
    changed("images.txt", "frame_0000", "../../frame_0000", &["leads out"]);
    changed("points3D.txt", "0.25 -0.5", "NaNN -0.5", &["line 2", "NaNN"]);
    write_text(root, &capture);
    let points = root.join("sparse/0/points3D.txt");
    let text = fs::read_to_string(&points).unwrap();
    fs::write(&points, text.replacen("0.25 -0.5", "nan -0.5", 1)).unwrap();
    let notes = Scene::open(root, &options()).unwrap().notes;
    assert!(notes.iter().any(|note| note.starts_with("1 points of the model are at no finite place")), "{notes:?}");
    write_text(root, &capture);
    fs::write(root.join("sparse/0/images.txt"), "# nothing\n").unwrap();
    refuses(root, &["images.txt", "0 posed images"]);
    write_text(root, &capture);
    for name in ["frame_0000.png", "frame_0001.png"] {
        fs::remove_file(root.join("images").join(name)).unwrap();
    }
    refuses(root, &["frame_0000.png", "missing"]);
}

#[test]
fn of_several_models_the_largest_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let whole = Capture::moving("frame_", 4, None);
    let mut part = Capture::moving("frame_", 4, None);
    part.shots.truncate(2);
    write_images(root, &whole);
    write_binary(root, &whole);
    fs::rename(root.join("sparse/0"), root.join("sparse/1")).unwrap();
    let alone = check(root, "colmap", &whole, by_name(&whole.shots));
    assert!(alone.notes.iter().all(|note| note.contains("2 points only")), "{:?}", alone.notes);
    fs::create_dir(root.join("sparse/0")).unwrap();
    write_text(root, &part);
    let scene = check(root, "colmap", &whole, by_name(&whole.shots));
    assert!(scene.notes[0].contains("2 models") && scene.notes[0].contains("sparse/1"), "{:?}", scene.notes);
}

#[test]
fn text_with_a_mark_at_its_beginning_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 2, None);
    write_images(folder.path(), &capture);
    write_text(folder.path(), &capture);
    for name in ["cameras.txt", "images.txt", "points3D.txt"] {
        let path = folder.path().join("sparse/0").join(name);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("\u{feff}{}", text.replace('\n', "\r\n"))).unwrap();
    }
    check(folder.path(), "colmap", &capture, by_name(&capture.shots));
}

#[test]
fn poses_without_the_lines_of_keypoints_are_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for prefix in ["frame_", "my frame ", "my own frame "] {
        let capture = Capture::moving(prefix, 4, None);
        write_images(root, &capture);
        write_text(root, &capture);
        let path = root.join("sparse/0/images.txt");
        let text = fs::read_to_string(&path).unwrap();
        let poses: Vec<&str> = text.lines().filter(|line| line.ends_with(".png")).collect();
        fs::write(&path, poses.join("\n")).unwrap();
        refuses(root, &["images.txt", "line 2", "keypoints", "two lines"]);
    }
}

#[test]
fn images_of_a_format_that_is_not_read_are_named_and_converted_ones_found() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let capture = Capture::moving("frame_", 2, None);
    write_images(root, &capture);
    write_text(root, &capture);
    let images = root.join("sparse/0/images.txt");
    let text = fs::read_to_string(&images).unwrap();
    fs::write(&images, text.replace(".png", ".TIF")).unwrap();
    for shot in &capture.shots {
        let path = root.join(format!("images/{}.png", shot.name));
        fs::rename(&path, path.with_extension("tif")).unwrap();
    }
    refuses(root, &["frame_0000", "format", "PNG", "ffmpeg"]);
    write_images(root, &capture);
    check(root, "colmap", &capture, by_name(&capture.shots));
}

#[test]
fn a_model_with_a_file_missing_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let capture = Capture::moving("frame_", 2, None);
    write_images(folder.path(), &capture);
    write_binary(folder.path(), &capture);
    fs::remove_file(folder.path().join("sparse/0/images.bin")).unwrap();
    refuses(folder.path(), &["cameras.bin and images.bin"]);
}
