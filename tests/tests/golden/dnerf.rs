//! The D-NeRF reader against the golden vectors `c12_dnerf_*` and their dataset `case12_data_*/dnerf`,
//! and the distances that give the initial scales against `c11_densify_*`.

use light4gs_data::composite;
use light4gs_data::mean_squared_distance_to_3_nearest;
use light4gs_data::{Camera, Frame, ImageStore, LoadOptions, Scene, Split, orbit_path};
use safetensors::SafeTensors;
use std::path::PathBuf;

const TOLERANCE: f32 = 1e-5;

/// The folder or file of the golden set whose name begins with `prefix`, whatever its letter, either in the set's
/// folder or in `datasets` in it.
fn golden(prefix: &str) -> PathBuf {
    let folder = light4gs_tests::golden::directory();
    let mut found: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .chain(std::fs::read_dir(folder.join("datasets")).into_iter().flatten())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(prefix))
        .collect();
    found.sort();
    found.into_iter().next().unwrap_or_else(|| panic!("no {prefix}* in {}", folder.display()))
}

fn floats(tensors: &SafeTensors, name: &str) -> Vec<f32> {
    let bytes = tensors.tensor(name).unwrap().data();
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

fn ints(tensors: &SafeTensors, name: &str) -> Vec<i32> {
    let bytes = tensors.tensor(name).unwrap().data();
    bytes.chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap())).collect()
}

fn close(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= TOLERANCE, "{what}[{i}]: {a}, expected {b}");
    }
}

/// Compares a camera with entry `i` of the tensors of a split.
fn check_camera(tensors: &SafeTensors, split: &str, i: usize, camera: &Camera, time: f32) {
    let entry =
        |name: &str, size: usize| floats(tensors, &format!("{split}.{name}"))[i * size..(i + 1) * size].to_vec();
    let label = |name: &str| format!("{split}.{name}[{i}]");
    // R is camera to world, row-major: the columns of world to camera in a row.
    close(&label("R"), &camera.rotation.to_cols_array(), &entry("R", 9));
    close(&label("T"), &camera.translation.to_array(), &entry("T", 3));
    close(&label("camera_center"), &camera.center().to_array(), &entry("camera_center", 3));
    let (fov_x, fov_y) = camera.fov();
    close(&label("FovX"), &[fov_x], &entry("FovX", 1));
    close(&label("FovY"), &[fov_y], &entry("FovY", 1));
    close(&label("time"), &[time], &entry("time", 1));
    // Matrices for row vectors, row-major: those for column vectors, column-major.
    let view = camera.view_matrix();
    close(&label("view"), &view.to_cols_array(), &entry("world_view_transform", 16));
    let clip = camera.projection_matrix(0.01, 100.0) * view;
    close(&label("full_proj"), &clip.to_cols_array(), &entry("full_proj_transform", 16));
}

/// The pose with the square image to which the reference resizes every image (we keep the true aspect ratio).
fn squared(camera: &Camera, size: (i32, i32)) -> Camera {
    assert_eq!(size.0, size.1);
    let focal = camera.fx * size.0 as f32 / camera.width as f32;
    let (width, height) = (size.0 as u32, size.1 as u32);
    Camera { fx: focal, fy: focal, cx: width as f32 / 2.0, cy: height as f32 / 2.0, width, height, ..*camera }
}

fn open(background: f32) -> (Scene, LoadOptions) {
    let options = LoadOptions { background: [background; 3], ..Default::default() };
    let scene = Scene::open(&golden("case12_data_").join("dnerf"), &options).unwrap();
    (scene, options)
}

#[test]
fn cameras_and_times() {
    let bytes = std::fs::read(golden("c12_dnerf_")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let (scene, _) = open(1.0);
    for split in [Split::Train, Split::Test] {
        let frames = scene.frames(split);
        let sizes = ints(&tensors, &format!("{split}.width_height"));
        assert_eq!(frames.len() * 2, sizes.len());
        for (i, frame) in frames.iter().enumerate() {
            let camera = squared(&frame.camera, (sizes[2 * i], sizes[2 * i + 1]));
            check_camera(&tensors, split.name(), i, &camera, frame.time);
            // Our own camera keeps square pixels and the image's size.
            assert_eq!(frame.camera.fx, frame.camera.fy);
            assert_eq!(frame.camera.width, frame.source_width);
        }
    }
    assert!(scene.val.is_empty());
    close("radius", &[scene.extent], &floats(&tensors, "nerf_normalization.radius"));
    let translate: Vec<f32> = scene.camera_mean.iter().map(|v| -v).collect();
    close("translate", &translate, &floats(&tensors, "nerf_normalization.translate"));
}

#[test]
fn video_path() {
    let bytes = std::fs::read(golden("c12_dnerf_")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let (scene, _) = open(1.0);
    let sizes = ints(&tensors, "video.width_height");
    let intrinsics = squared(&scene.train[0].camera, (sizes[0], sizes[1]));
    let path = orbit_path(scene.video.len(), 4.0, 30.0, &intrinsics);
    for (i, &index) in ints(&tensors, "video.frame_index").iter().enumerate() {
        let (camera, time) = path[index as usize];
        check_camera(&tensors, "video", i, &camera, time);
        let ours: &Frame = &scene.video[index as usize];
        assert_eq!((ours.camera.rotation, ours.time), (camera.rotation, time));
    }
}

#[test]
fn compositing_is_exact() {
    let bytes = std::fs::read(golden("c12_dnerf_")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let rgba = tensors.tensor("composite.rgba_u8").unwrap();
    let per_image: usize = rgba.shape()[1..].iter().product();
    for (name, value) in [("white", 1.0f32), ("black", 0.0)] {
        let expected = tensors.tensor(&format!("composite.{name}_u8")).unwrap();
        assert!(composite(rgba.data(), [value; 3]) == expected.data(), "{name}");
        // The same, read from the files.
        let (scene, options) = open(value);
        let store = ImageStore::new(&options, 1 << 20);
        let images = expected.data().chunks_exact(per_image / 4 * 3);
        assert_eq!(images.len(), scene.train.len());
        for (frame, expected) in scene.train.iter().zip(images) {
            assert!(store.get(frame).unwrap().pixels == expected, "{name} {}", frame.name);
        }
    }
}

#[test]
fn random_points() {
    let bytes = std::fs::read(golden("c12_dnerf_")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let (scene, _) = open(1.0);
    assert_eq!(scene.points.len() as i32, ints(&tensors, "init.num_points")[0]);
    let range = floats(&tensors, "init.xyz_range");
    let dc_range = floats(&tensors, "init.sh_dc_range");
    let inside = |v: &f32, range: &[f32]| *v >= range[0] - 1e-6 && *v <= range[1] + 1e-6;
    assert!(scene.points.positions.iter().flatten().all(|v| inside(v, &range)));
    assert!(scene.points.sh_dc().iter().flatten().all(|v| inside(v, &dc_range)));
}

#[test]
fn initial_scales() {
    let bytes = std::fs::read(golden("c11_densify_")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let points: Vec<[f32; 3]> = floats(&tensors, "init.points").chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    let found = mean_squared_distance_to_3_nearest(&points);
    // The file has the distances without the clamp; the clamp is in its logarithms.
    let means = floats(&tensors, "init.mean_dist2");
    let clamped: Vec<f32> = means.iter().map(|m| m.max(1e-7)).collect();
    close("mean_dist2", &found, &clamped);
    let logs: Vec<f32> = found.iter().flat_map(|m| [0.5 * m.ln(); 3]).collect();
    close("scaling_log", &logs, &floats(&tensors, "init.scaling_log"));
}
