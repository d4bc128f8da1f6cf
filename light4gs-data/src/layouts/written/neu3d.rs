//! The layout `neu3d`: LLFF's table, and a folder for each camera.

use super::capture::{Capture, Shot};
use super::*;
use std::fs;

/// An array of float64 as `.npy`.
pub(crate) fn npy(rows: usize, columns: usize, values: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}\n");
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    out
}

/// LLFF's row of a camera: columns down, right, back, center; height, width, focal length for twice the size.
fn row(shot: &Shot) -> Vec<f64> {
    let to_world = shot.pinhole.rotation.transpose();
    let (right, down, back) = (to_world.x_axis, to_world.y_axis, -to_world.z_axis);
    let center = shot.pinhole.center();
    let camera = shot.pinhole;
    let size = [2.0 * f64::from(camera.height), 2.0 * f64::from(camera.width), 2.0 * f64::from(camera.fx)];
    let mut row: Vec<f64> =
        (0..3).flat_map(|i| [down[i].into(), right[i].into(), back[i].into(), center[i].into(), size[i]]).collect();
    row.extend([1.0, 6.0]);
    row
}

pub(crate) fn rig(cameras: usize, instants: usize) -> Capture {
    let plan = (0..cameras).flat_map(|c| {
        (0..instants).map(move |i| (format!("cam{c:02}_{i:04}"), c as f32 / 3.0, i as f32 / instants as f32, None))
    });
    Capture::new(true, plan.collect())
}

pub(crate) fn write(root: &Path, capture: &Capture, instants: usize) {
    let mut table = Vec::new();
    for (i, shot) in capture.shots.iter().enumerate() {
        let (camera, instant) = (i / instants, i % instants);
        if instant == 0 {
            table.extend(row(shot));
        }
        let folder = root.join(format!("cam{camera:02}/images"));
        fs::create_dir_all(&folder).unwrap();
        capture.recorded(i).save_png(&folder.join(format!("{instant:04}.png"))).unwrap();
    }
    fs::write(root.join("poses_bounds.npy"), npy(table.len() / 17, 17, &table)).unwrap();
}

#[test]
fn a_rig_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let capture = rig(3, 4);
    write(folder.path(), &capture, 4);
    let scene = check(folder.path(), "neu3d", &capture, by_name(&capture.shots));
    assert_eq!((scene.train.len(), scene.test.len(), scene.video.len()), (8, 4, 300));
    assert!(scene.test.iter().all(|frame| frame.camera_id == 0));
    assert_eq!(times(&scene, Split::Train), [0.0, 0.25, 0.5, 0.75]);
    assert_eq!(scene.seconds, Some(4.0 / 30.0));
    let slower = LoadOptions { frames_a_second: Some(20.0), ..options() };
    let seconds = Scene::open(folder.path(), &slower).unwrap().seconds;
    assert!(seconds.is_some_and(|seconds| (seconds - 0.2).abs() < 1e-6), "{seconds:?}");
    // Random points lie around the place that the cameras look at.
    let mean = scene.points.positions.iter().fold(Vec3::ZERO, |sum, p| sum + Vec3::from(*p)) / 2000.0;
    assert!(mean.length() < 0.3, "{mean}");
}

#[test]
fn a_missing_frame_leaves_a_gap_and_a_limit_takes_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let capture = rig(2, 4);
    write(folder.path(), &capture, 4);
    fs::remove_file(folder.path().join("cam01/images/0001.png")).unwrap();
    let scene = Scene::open(folder.path(), &options()).unwrap();
    assert_eq!(times(&scene, Split::Train), [0.0, 0.5, 0.75]);
    assert!(scene.notes[0].contains("cam01 has 3, others up to 4"), "{:?}", scene.notes);
    let first = LoadOptions { frames: Some(3), ..options() };
    let scene = Scene::open(folder.path(), &first).unwrap();
    assert_eq!(times(&scene, Split::Test), [0.0, 1.0 / 3.0, 2.0 / 3.0]);
    // Other folders are no cameras, and one camera is too few.
    fs::create_dir_all(folder.path().join("colmap")).unwrap();
    fs::copy(folder.path().join("cam00/images/0000.png"), folder.path().join("colmap/x.png")).unwrap();
    assert!(Scene::open(folder.path(), &options()).is_ok());
    fs::remove_dir_all(folder.path().join("cam01")).unwrap();
    let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
    assert!(message.contains("at least 2 cameras"), "{message}");
}

#[test]
fn a_damaged_table_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let capture = rig(2, 1);
    write(folder.path(), &capture, 1);
    let good: Vec<f64> = capture.shots.iter().flat_map(row).collect();
    let refuses = |table: Vec<u8>, words: &[&str]| {
        fs::write(folder.path().join("poses_bounds.npy"), table).unwrap();
        let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
        for word in words.iter().chain(&["poses_bounds.npy", "; "]) {
            assert!(message.contains(word), "`{word}` is not in: {message}");
        }
    };
    let changed = |i: usize, value: f64| {
        let mut table = good.clone();
        table[i] = value;
        npy(2, 17, &table)
    };
    refuses(changed(4, 0.0), &["row 0", "height is 0"]);
    refuses(changed(17 + 14, -3.0), &["row 1", "focal length is -3"]);
    refuses(changed(0, 9.0), &["row 0", "not a rotation"]);
    refuses(changed(5, f64::NAN), &["[0, 5]", "NaN"]);
    refuses(npy(1, 17, &good[..17]), &["1 rows for 2 cameras (cam00, cam01)"]);
    refuses(npy(2, 15, &good[..30]), &["shape", "(N, 17)"]);
    refuses(npy(2, 17, &good)[..100].to_vec(), &["data"]);
    fs::write(folder.path().join("poses_bounds.npy"), npy(2, 17, &good)).unwrap();
    for camera in ["cam00", "cam01"] {
        fs::remove_dir_all(folder.path().join(camera)).unwrap();
    }
    let message = Scene::open(folder.path(), &options()).unwrap_err().to_string();
    assert!(message.contains("no camera found") && message.contains("cam00.mp4"), "{message}");
}
