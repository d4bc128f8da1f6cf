//! The readers of captures against the golden vectors `c12_neu3d_*` and `c12_hypernerf_*` and their datasets
//! `case12_data_*`. `LIGHT4GS_GOLDEN` names another set.

use light4gs_data::{Camera, Frame, LoadOptions, Resolution, Scene, Split};
use safetensors::SafeTensors;
use std::path::PathBuf;

const TOLERANCE: f32 = 1e-5;

/// The folder or file of the golden set whose name begins with `prefix`, whatever the letter of the set; in the set's
/// folder or in `datasets` there.
fn golden(prefix: &str) -> PathBuf {
    let folder = std::env::var_os("LIGHT4GS_GOLDEN")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden")), PathBuf::from);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let inner = std::fs::read_dir(folder.join("datasets")).into_iter().flatten();
    let mut found: Vec<PathBuf> = entries
        .chain(inner)
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(prefix))
        .collect();
    found.sort();
    found.into_iter().next().unwrap_or_else(|| panic!("no {prefix}* in {}", folder.display()))
}

struct Tensors(Vec<u8>);

impl Tensors {
    fn open(prefix: &str) -> Self {
        Self(std::fs::read(golden(prefix)).unwrap())
    }

    fn words(&self, name: &str) -> Vec<[u8; 4]> {
        let file = SafeTensors::deserialize(&self.0).unwrap();
        file.tensor(name).unwrap_or_else(|_| panic!("no tensor {name}")).data().as_chunks().0.to_vec()
    }

    fn floats(&self, name: &str) -> Vec<f32> {
        self.words(name).into_iter().map(f32::from_le_bytes).collect()
    }

    fn integers(&self, name: &str) -> Vec<usize> {
        self.words(name).into_iter().map(|word| i32::from_le_bytes(word) as usize).collect()
    }
}

#[track_caller]
fn close(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= TOLERANCE, "{what}[{i}]: {a}, expected {b}");
    }
}

/// Compares a frame with entry `i` of the tensors of a split.
fn check(tensors: &Tensors, split: &str, i: usize, frame: &Frame) {
    let entry = |name: &str, size: usize| tensors.floats(&format!("{split}.{name}"))[i * size..(i + 1) * size].to_vec();
    let label = |name: &str| format!("{split}.{name}[{i}] ({})", frame.name);
    let camera: &Camera = &frame.camera;
    // R is camera to world, row-major: the columns of world to camera in a row.
    close(&label("R"), &camera.rotation.to_cols_array(), &entry("R", 9));
    close(&label("T"), &camera.translation.to_array(), &entry("T", 3));
    close(&label("camera_center"), &camera.center().to_array(), &entry("camera_center", 3));
    let (fov_x, fov_y) = camera.fov();
    close(&label("FovX"), &[fov_x], &entry("FovX", 1));
    close(&label("FovY"), &[fov_y], &entry("FovY", 1));
    close(&label("time"), &[frame.time], &entry("time", 1));
    // Matrices for row vectors, row-major: those for column vectors, column-major.
    let view = camera.view_matrix();
    close(&label("view"), &view.to_cols_array(), &entry("world_view_transform", 16));
    let clip = camera.projection_matrix(0.01, 100.0) * view;
    close(&label("full_proj"), &clip.to_cols_array(), &entry("full_proj_transform", 16));
}

fn check_normalization(tensors: &Tensors, scene: &Scene) {
    close("radius", &[scene.extent], &tensors.floats("nerf_normalization.radius"));
    let translate: Vec<f32> = scene.camera_mean.iter().map(|v| -v).collect();
    close("translate", &translate, &tensors.floats("nerf_normalization.translate"));
}

/// The reference resizes every image to 1352 × 1014 and assumes 300 frames.
fn neu3d() -> Scene {
    let resolution = Resolution::Exact { width: 1352, height: 1014 };
    let options = LoadOptions { resolution, frames: Some(300), ..Default::default() };
    Scene::open(&golden("case12_data_").join("neu3d"), &options).unwrap()
}

#[test]
fn neu3d_cameras_splits_and_times() {
    let tensors = Tensors::open("c12_neu3d_");
    let scene = neu3d();
    assert_eq!(scene.layout, "neu3d");
    for split in [Split::Train, Split::Test] {
        let frames = scene.frames(split);
        let name = |field: &str| format!("{split}.{field}");
        assert_eq!(frames.len(), tensors.integers(&name("n_entries"))[0]);
        let times: Vec<f32> = frames.iter().map(|frame| frame.time).collect();
        close(&name("all_times"), &times, &tensors.floats(&name("all_times")));
        let cameras: Vec<usize> = frames.iter().map(|frame| frame.camera_id as usize).collect();
        assert_eq!(cameras, tensors.integers(&name("source_camera")));
        let sizes = tensors.integers(&name("width_height"));
        let focal = tensors.floats(&name("focal"));
        for (i, &entry) in tensors.integers(&name("entry_index")).iter().enumerate() {
            let frame = &frames[entry];
            check(&tensors, split.name(), i, frame);
            assert_eq!([frame.camera.width as usize, frame.camera.height as usize], sizes[2 * i..2 * i + 2]);
            assert!((frame.camera.fx - focal[0]).abs() < 1e-3 && (frame.camera.fy - focal[1]).abs() < 1e-3);
        }
    }
    check_normalization(&tensors, &scene);
}

/// The reference's own spiral is mirrored (its rotations have determinant -1): its right axis is the negative of ours.
/// Everything else agrees.
#[test]
fn neu3d_spiral() {
    let tensors = Tensors::open("c12_neu3d_");
    let scene = neu3d();
    assert_eq!(scene.video.len(), tensors.integers("spiral.n")[0]);
    let (rotations, translations) = (tensors.floats("spiral.R"), tensors.floats("spiral.T"));
    for (i, (rotation, translation)) in rotations.chunks(9).zip(translations.chunks(3)).enumerate() {
        let camera = scene.video[25 * i].camera;
        let axes = camera.rotation.to_cols_array();
        let mirrored: Vec<f32> = axes.iter().enumerate().map(|(k, v)| if k % 3 == 0 { -v } else { *v }).collect();
        close(&format!("spiral.R[{i}]"), &mirrored, rotation);
        let [x, y, z] = camera.translation.to_array();
        close(&format!("spiral.T[{i}]"), &[-x, y, z], translation);
    }
}

#[test]
fn hypernerf_cameras_splits_and_times() {
    let tensors = Tensors::open("c12_hypernerf_");
    let root = golden("case12_data_").join("hypernerf");
    let scene = Scene::open(&root, &LoadOptions::default()).unwrap();
    assert_eq!(scene.layout, "hypernerf");
    let all_times: Vec<f32> = scene.video.iter().map(|frame| frame.time).collect();
    close("all_time", &all_times, &tensors.floats("all_time"));
    for split in [Split::Train, Split::Test] {
        let indices = tensors.integers(&format!("{split}.source_index"));
        let frames = scene.frames(split);
        assert_eq!(frames.len(), indices.len());
        for (i, (frame, index)) in frames.iter().zip(indices).enumerate() {
            assert_eq!(frame.name, scene.video[index].name);
            check(&tensors, split.name(), i, frame);
        }
    }
    check_normalization(&tensors, &scene);
    // The reference ignores the principal point; it is used here.
    let camera = std::fs::read_to_string(root.join(format!("camera/{}.json", scene.train[0].name))).unwrap();
    let camera: serde_json::Value = serde_json::from_str(&camera).unwrap();
    let expected = camera["principal_point"][0].as_f64().unwrap() / camera["image_size"][0].as_f64().unwrap();
    let found = f64::from(scene.train[0].camera.cx) / f64::from(scene.train[0].camera.width);
    assert!((found - expected).abs() < 1e-6);
    let bent = camera["radial_distortion"][0].as_f64().unwrap() != 0.0;
    assert_eq!(scene.train[0].lens.is_some(), bent);
}
