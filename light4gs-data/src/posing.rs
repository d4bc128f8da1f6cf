//! Whether poses are good enough: thresholds, and the parallax, the angle at which the scene sees its cameras apart.

use glam::DVec3;

/// With a smaller share of the images, poses break off, and those at the edges are poor, too.
pub(crate) const LEAST_REGISTERED: f64 = 0.8;
/// With a smaller parallax, in degrees, there is no depth.
pub(crate) const LEAST_PARALLAX: f64 = 1.5;

/// The angle, in degrees, at which a point at the usual depth sees the two cameras that are farthest apart.
pub(crate) fn parallax(centers: &[DVec3], points: &[[f32; 3]]) -> f64 {
    let between = centers.iter().flat_map(|a| centers.iter().map(move |b| a.distance(*b)));
    let extent = between.fold(0.0, f64::max);
    let mean = centers.iter().sum::<DVec3>() / centers.len().max(1) as f64;
    let mut depths: Vec<f64> = points.iter().map(|point| mean.distance(DVec3::from(point.map(f64::from)))).collect();
    depths.sort_by(f64::total_cmp);
    let depth = depths.get(depths.len() / 2).copied().unwrap_or(0.0);
    if extent > 0.0 { (2.0 * (extent / (2.0 * depth)).atan()).to_degrees() } else { 0.0 }
}
