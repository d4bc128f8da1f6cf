//! Cameras around a scene without a dataset: views for comparing the coded scene with the imported one.

use std::path::Path;

use glam::Vec3;
use light4gs_codec::GaussianArrays;
use light4gs_codec::rendering::NEAR;
use light4gs_data::{Camera, Frame, PointCloud, SH_C0, Scene, SplitFrames};

use super::extent::Extent;
use crate::error::TrainError;

/// Number of cameras around the scene, each at another time.
const VIEWS: usize = 8;
/// Side of their square images in pixels, and their field of view in radians.
const SIDE: u32 = 400;
const FIELD_OF_VIEW: f32 = 0.7;
/// Distance of the cameras in radii of the scene.
const DISTANCE: f32 = 2.5;
/// The least distance, world units: what is nearer than [`NEAR`] is not drawn.
const LEAST_DISTANCE: f32 = 2.0 * NEAR;

/// The scene as a dataset of cameras without images, which stand around the middle of the Gaussians and look at it.
///
/// # Errors
/// [`TrainError::Data`] if there are no Gaussians.
pub fn scene_around(gaussians: &GaussianArrays, root: &Path, background: [f32; 3]) -> Result<Scene, TrainError> {
    let extent = Extent::of(gaussians);
    let center = extent.center.as_vec3();
    let usual = DISTANCE * extent.radius as f32;
    let distance = usual.max(LEAST_DISTANCE);
    // From farther away, through a longer lens.
    let field_of_view = match distance > usual {
        true => 2.0 * ((0.5 * FIELD_OF_VIEW).tan() * usual / distance).atan(),
        false => FIELD_OF_VIEW,
    };
    let frame = |view: usize| {
        // Alternately from above and from below, so that all sides are seen.
        let angle = view as f32 / VIEWS as f32 * std::f32::consts::TAU;
        let height = if view.is_multiple_of(2) { 0.5 } else { -0.25 };
        let eye = center + distance * Vec3::new(angle.cos(), angle.sin(), height);
        let camera = Camera::look_at(eye, center, Vec3::Z, field_of_view, SIDE, SIDE);
        Frame::without_image(format!("view-{view}"), camera, view as f32 / (VIEWS - 1) as f32)
    };
    let frames: Vec<Frame> = (0..VIEWS).map(frame).collect();
    let points = PointCloud {
        positions: gaussians.means.clone(),
        colors: gaussians.sh_dc.iter().map(|dc| dc.map(|value| (value * SH_C0 + 0.5).clamp(0.0, 1.0))).collect(),
    };
    let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
    Ok(Scene::new("import", root, frames, points, background)?)
}
