//! Cameras around a scene without a dataset: views for comparing the coded scene with the imported one.

use std::path::Path;

use glam::Vec3;
use light4gs_codec::GaussianArrays;
use light4gs_data::{Camera, Frame, PointCloud, SH_C0, Scene, SplitFrames};

use crate::error::TrainError;

/// Number of cameras around the scene, each at another time.
const VIEWS: usize = 8;
/// Side of their square images in pixels, and their field of view in radians.
const SIDE: u32 = 400;
const FIELD_OF_VIEW: f32 = 0.7;
/// This share of the Gaussians is taken as the scene; in real captures the others are its far background.
const CORE: f32 = 0.8;
/// Distance of the cameras in radii of that core.
const DISTANCE: f32 = 2.5;

/// The scene as a dataset of cameras without images, which stand around the middle of the Gaussians and look at it.
///
/// # Errors
/// [`TrainError::Data`] if there are no Gaussians.
pub fn scene_around(gaussians: &GaussianArrays, root: &Path, background: [f32; 3]) -> Result<Scene, TrainError> {
    let middle = |axis: usize| quantile(gaussians.means.iter().map(|mean| mean[axis]).collect(), 0.5);
    let center = Vec3::new(middle(0), middle(1), middle(2));
    let radius = quantile(gaussians.means.iter().map(|mean| center.distance((*mean).into())).collect(), CORE);
    let distance = DISTANCE * radius.max(f32::MIN_POSITIVE);
    let frame = |view: usize| {
        // Alternately from above and from below, so that all sides are seen.
        let angle = view as f32 / VIEWS as f32 * std::f32::consts::TAU;
        let height = if view.is_multiple_of(2) { 0.5 } else { -0.25 };
        let eye = center + distance * Vec3::new(angle.cos(), angle.sin(), height);
        let camera = Camera::look_at(eye, center, Vec3::Z, FIELD_OF_VIEW, SIDE, SIDE);
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

fn quantile(mut values: Vec<f32>, share: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    let at = (share * values.len().saturating_sub(1) as f32) as usize;
    values.get(at).copied().unwrap_or(0.0)
}
