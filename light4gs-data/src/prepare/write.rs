//! Writing the dataset: `transforms.json` and `points3D.ply`, from COLMAP's model.

use super::poses::posed_images;
use super::{PrepareOptions, PrepareSummary, frame_names};
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::layouts::colmap::model::{Model, ModelCamera, ModelImage};
use crate::layouts::shared::files;
use crate::lens::Distortion;
use crate::ply::Encoding;
use crate::programs::ffmpeg::Taken;
use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::io::Write;

/// Mean distance of the cameras to the middle of the points, world units. It is that of D-NeRF's synthetic scenes, so
/// that thresholds in world units mean the same.
const CAMERA_DISTANCE: f64 = 4.0;

/// Writes the dataset, and summarizes it.
pub(super) fn dataset(
    options: &PrepareOptions,
    cameras: &[String],
    mut model: Model,
    notes: Vec<String>,
) -> Result<PrepareSummary, DataError> {
    let wanted = posed_images(options, cameras)?.len();
    let registered = model.images.len();
    normalize(&mut model);
    let posed: HashMap<&str, &ModelImage> = model.images.iter().map(|image| (image.name.as_str(), image)).collect();
    let lists = frame_names(&options.out, cameras)?;
    let stands = cameras.len() > 1 && !options.moving_rig;
    let count = lists.first().map_or(0, Vec::len);
    // Frames of a single camera have the times at which they are shown. Those of a rig were taken evenly.
    let taken = taken(options, cameras)?;
    // Of frames that were taken evenly, the number counts seconds at this rate.
    let rate = if cameras.len() == 1 { 1.0 } else { taken.as_ref().map_or(0.0, Taken::rate) };
    let is_timed = taken.is_some() && rate > 0.0;
    let shown = taken.filter(|taken| cameras.len() == 1 && taken.seconds.len() == count);
    let seconds = shown.map_or_else(|| (0..count).map(|i| i as f64).collect(), |taken| taken.seconds);
    let mut placed = Vec::new();
    let mut used = 0;
    for list in &lists {
        // A camera that stands still has the pose of its first frame.
        let of_camera = list.first().and_then(|name| posed.get(name.as_str()));
        let before = placed.len();
        for (name, seconds) in list.iter().zip(&seconds) {
            let image = if stands { of_camera } else { posed.get(name.as_str()) };
            placed.extend(image.map(|image| (name, *seconds, *image)));
        }
        used += usize::from(placed.len() > before);
    }
    // From the first frame with a pose to the last: nothing shows the time before and after.
    let times = || placed.iter().map(|(_, seconds, _)| *seconds);
    let (first, last) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    let span = if last > first { last - first } else { 1.0 };
    let frames: Vec<Value> = placed
        .iter()
        .map(|(name, seconds, image)| frame(name, (seconds - first) / span, image, &model.cameras[&image.camera]))
        .collect();
    let summary = PrepareSummary {
        images: wanted,
        registered,
        reprojection_error: model.error.unwrap_or(0.0),
        points: model.points.len(),
        frames: frames.len(),
        cameras: used,
        parallax: parallax(&model),
        notes,
    };
    model.points.write_ply(&options.out.join("points3D.ply"), Encoding::BinaryLittleEndian)?;
    let mut document = json!({ "ply_file_path": "points3D.ply", "frames": frames });
    if is_timed && last > first {
        document["seconds"] = json!((last - first) / rate);
    }
    let path = options.out.join("transforms.json");
    write_atomically(&path, |out| writeln!(out, "{document:#}"))?;
    Ok(summary)
}

/// The record of the frames of the first camera's video.
fn taken(options: &PrepareOptions, cameras: &[String]) -> Result<Option<Taken>, DataError> {
    let Some(camera) = cameras.first() else { return Ok(None) };
    let folder = options.out.join("images").join(camera);
    Ok(Taken::read(&folder, files::images(&folder)?.len()))
}

fn frame(name: &str, time: f64, image: &ModelImage, camera: &ModelCamera) -> Value {
    let to_world = image.rotation.transpose();
    // OpenGL axes: y and z change sign.
    let (x, y, z) = (to_world.x_axis, -to_world.y_axis, -to_world.z_axis);
    let row = |i: usize| json!([x[i], y[i], z[i], image.center[i]]);
    let k = camera.intrinsics;
    let mut value = json!({
        "file_path": format!("images/{name}"),
        "time": time,
        "transform_matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
        "camera_model": "OPENCV",
        "w": k.width, "h": k.height, "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy,
    });
    if let Some(Distortion::RadialTangential { radial, tangential }) = camera.lens.map(|lens| lens.distortion) {
        (value["k1"], value["k2"]) = (json!(radial[0]), json!(radial[1]));
        (value["p1"], value["p2"]) = (json!(tangential[0]), json!(tangential[1]));
    }
    value
}

/// The median of each coordinate of the points.
fn middle(model: &Model) -> DVec3 {
    let mut middle = DVec3::ZERO;
    for axis in 0..3 {
        let mut values: Vec<f32> = model.points.positions.iter().map(|point| point[axis]).collect();
        values.sort_by(f32::total_cmp);
        middle[axis] = values.get(values.len() / 2).copied().unwrap_or(0.0).into();
    }
    middle
}

/// See [`crate::posing::parallax`].
pub(super) fn parallax(model: &Model) -> f64 {
    let centers: Vec<DVec3> = model.images.iter().map(|image| image.center).collect();
    crate::posing::parallax(&centers, &model.points.positions)
}

/// COLMAP's world has an arbitrary origin, orientation and size. Turns the mean upward direction of the cameras to z,
/// moves the middle of the points to the origin, and scales to the usual distance of the cameras.
fn normalize(model: &mut Model) {
    let up = model.images.iter().map(|image| -image.rotation.row(1)).sum::<DVec3>().normalize_or(DVec3::Z);
    let side = up.any_orthonormal_vector();
    let turn = DMat3::from_cols(side, up.cross(side), up).transpose();
    let middle = middle(model);
    let count = model.images.len().max(1) as f64;
    let distance = model.images.iter().map(|image| image.center.distance(middle)).sum::<f64>() / count;
    let scale = if distance > 1e-9 { CAMERA_DISTANCE / distance } else { 1.0 };
    for image in &mut model.images {
        image.center = turn * (image.center - middle) * scale;
        image.rotation *= turn.transpose();
    }
    for position in &mut model.points.positions {
        let moved = turn * (DVec3::from(position.map(f64::from)) - middle) * scale;
        *position = moved.as_vec3().to_array();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Intrinsics, PointCloud, RgbImage8};

    /// The first and the last of six frames have no pose, so time runs from the second to the fifth.
    #[test]
    fn times_are_those_of_frames_with_a_pose() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        std::fs::create_dir_all(out.join("images")).unwrap();
        for i in 0..6 {
            let image = RgbImage8 { width: 8, height: 8, pixels: vec![9; 192] };
            image.save_png(&out.join(format!("images/{i:04}.png"))).unwrap();
        }
        let image = |i: u32| ModelImage {
            name: format!("{i:04}.png"),
            rotation: DMat3::IDENTITY,
            center: DVec3::new(f64::from(i), 0.0, -4.0),
            camera: 1,
        };
        let intrinsics = Intrinsics { width: 8, height: 8, fx: 9.0, fy: 9.0, cx: 4.0, cy: 4.0 };
        let model = || Model {
            cameras: [(1, ModelCamera { intrinsics, lens: None })].into(),
            images: (1..5).map(image).collect(),
            points: PointCloud { positions: vec![[0.0; 3], [1.0; 3]], colors: vec![[0.5; 3]; 2] },
            error: Some(0.5),
            points_not_finite: 0,
            images_file: out.join("images.bin"),
        };
        let options = PrepareOptions::new(vec![folder.path().join("a.mp4")], out.clone());
        let summary = dataset(&options, &[String::new()], model(), Vec::new()).unwrap();
        assert_eq!((summary.images, summary.registered, summary.frames, summary.cameras), (6, 4, 4, 1));
        let written = |expected: [f64; 4]| {
            let text = std::fs::read_to_string(out.join("transforms.json")).unwrap();
            let document: Value = serde_json::from_str(&text).unwrap();
            let times = document["frames"].as_array().unwrap().iter().map(|frame| frame["time"].as_f64().unwrap());
            assert!(times.zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12));
            document["seconds"].as_f64()
        };
        assert_eq!(written([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]), None);
        // Times of presentation: those of frames with a pose are from 0.5 to 3 seconds.
        let record = json!({
            "video": "a.mp4", "content": {"length": 3, "hash": "0"}, "notes": [], "seconds": [0.0, 0.5, 1.0, 2.0, 3.0, 4.0],
        });
        std::fs::write(out.join("images/frames.json"), record.to_string()).unwrap();
        dataset(&options, &[String::new()], model(), Vec::new()).unwrap();
        assert_eq!(written([0.0, 0.2, 0.6, 1.0]), Some(2.5));
    }
}
