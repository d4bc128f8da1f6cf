//! Points to start from: those of a capture, or random ones where its cameras look.

use super::cloud::PointCloud;
use crate::error::DataError;
use crate::frame::Frame;
use crate::options::LoadOptions;
use glam::{DMat3, DVec3};
use std::path::Path;

/// Names of point clouds, in the order in which they are tried: the reference's thinned cloud; then the names that
/// COLMAP and 3DGS write; then those of nerfstudio and the D-NeRF layout.
const NAMES: [&str; 8] = [
    "points3D_downsample2.ply",
    "points3D_downsample.ply",
    "points3D.ply",
    "sparse_pc.ply",
    "points3d.ply",
    "fused.ply",
    "sparse/0/points3D.ply",
    "point_cloud.ply",
];

impl PointCloud {
    /// The PLY file of points in a dataset's folder, if there is one.
    pub(crate) fn find(root: &Path) -> Result<Option<Self>, DataError> {
        let found = NAMES.iter().map(|name| root.join(name)).find(|path| path.is_file());
        found.map(|path| Self::read_ply(&path)).transpose()
    }

    /// Random points where the cameras look: in a cube around the point that is nearest to all their axes, which
    /// extends half the way to the cameras. Without such a point (if all axes are parallel), it is the cube of the
    /// options.
    pub(crate) fn in_front_of(frames: &[Frame], options: &LoadOptions) -> Self {
        let (center, half) = seen(frames).unwrap_or((DVec3::ZERO, options.random_half_size.into()));
        let mut cloud = Self::random(options.random_points.min(options.most_points), half as f32, options.seed);
        for position in &mut cloud.positions {
            for (value, shift) in position.iter_mut().zip(center.to_array()) {
                *value += shift as f32;
            }
        }
        cloud
    }
}

/// The point nearest to the axes of all cameras, and half the mean distance of the cameras from it.
fn seen(frames: &[Frame]) -> Option<(DVec3, f64)> {
    let mut matrix = DMat3::ZERO;
    let mut vector = DVec3::ZERO;
    for frame in frames {
        let axis = frame.camera.rotation.row(2).as_dvec3().normalize_or_zero();
        let across = DMat3::IDENTITY - DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        matrix += across;
        vector += across * frame.camera.center().as_dvec3();
    }
    let count = frames.len().max(1) as f64;
    // If axes are parallel, the matrix is singular. If they are almost parallel, the point is noise.
    if (matrix / count).determinant().abs() < 1e-6 {
        return None;
    }
    let center = matrix.inverse() * vector;
    let distance = frames.iter().map(|frame| frame.camera.center().as_dvec3().distance(center)).sum::<f64>() / count;
    (center.is_finite() && distance > 0.0 && distance.is_finite()).then_some((center, 0.5 * distance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use glam::Vec3;

    #[test]
    fn random_points_are_where_the_cameras_look() {
        let target = Vec3::new(10.0, -4.0, 2.0);
        let frames: Vec<Frame> = (0..5)
            .map(|i| {
                let angle = i as f32 * 0.3;
                let eye = target + 6.0 * Vec3::new(angle.cos(), angle.sin(), 0.2);
                Frame::without_image("", Camera::look_at(eye, target, Vec3::Z, 0.7, 8, 8), 0.0)
            })
            .collect();
        let (center, half) = seen(&frames).unwrap();
        assert!(center.distance(target.as_dvec3()) < 1e-3 && (half - 3.06).abs() < 0.01, "{center} {half}");
        let options = LoadOptions { random_points: 50, ..Default::default() };
        let cloud = PointCloud::in_front_of(&frames, &options);
        assert!(cloud.positions.iter().all(|p| (Vec3::from(*p) - target).abs().max_element() < 3.1));
        let parallel = vec![frames[0].clone(); 3];
        let around_origin = PointCloud::in_front_of(&parallel, &options);
        assert!(around_origin.positions.iter().flatten().all(|v| v.abs() <= 1.3));
    }
}
