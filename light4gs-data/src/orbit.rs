//! Video paths: a camera that circles the scene while time goes on.

use crate::camera::Camera;
use glam::Vec3;
use std::f64::consts::TAU;

/// `frames` cameras on a circle around the origin (world z up), all looking at the origin, with
/// their times.
///
/// `radius` is the distance to the origin in world units, `elevation_degrees` the height above the
/// horizon. The path starts at -y, turns clockwise seen from above (towards -x) and does not repeat
/// its first camera; time runs from 0 to 1, both included (a single frame has time 0). Focal
/// lengths, principal point and size are those of `intrinsics`; its pose is not used.
pub fn orbit_path(frames: usize, radius: f32, elevation_degrees: f32, intrinsics: &Camera) -> Vec<(Camera, f32)> {
    let elevation = f64::from(elevation_degrees).to_radians();
    let radius = f64::from(radius);
    (0..frames)
        .map(|i| {
            let angle = TAU * i as f64 / frames as f64;
            let eye = Vec3::new(
                (-radius * elevation.cos() * angle.sin()) as f32,
                (-radius * elevation.cos() * angle.cos()) as f32,
                (radius * elevation.sin()) as f32,
            );
            let pose = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 1.0, 1, 1);
            let camera = Camera { rotation: pose.rotation, translation: pose.translation, ..*intrinsics };
            let time = i as f64 / frames.saturating_sub(1).max(1) as f64;
            (camera, time as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_camera_looks_at_the_origin_from_the_circle() {
        let intrinsics = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 40, 30);
        let path = orbit_path(7, 4.0, 30.0, &intrinsics);
        assert_eq!(path.len(), 7);
        assert_eq!((path[0].1, path[6].1), (0.0, 1.0));
        for (camera, _) in &path {
            let (u, v, depth) = camera.project(Vec3::ZERO);
            assert!((u - 19.5).abs() < 1e-3 && (v - 14.5).abs() < 1e-3);
            assert!((depth - 4.0).abs() < 1e-5 && (camera.center().z - 2.0).abs() < 1e-5);
        }
        assert!(orbit_path(0, 4.0, 30.0, &intrinsics).is_empty());
        assert_eq!(orbit_path(1, 4.0, 30.0, &intrinsics)[0].1, 0.0);
    }
}
