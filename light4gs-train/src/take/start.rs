//! Where the Gaussians of a segment begin: at what the base behind it does not explain.
//!
//! Points are drawn along the rays of pixels that differ from the base, before the base's surface. A point of something that is
//! there projects onto differing pixels in all cameras of its time, so the points are ranked by their share of such
//! views (space carving, Kutulakos and Seitz 2000, with the residual as silhouette). One moving camera has no second view of a
//! time; there the views of all times count, and what moves slowly is found.

use std::collections::BTreeMap;

use burn::tensor::Device;
use glam::Vec3;
use light4gs_data::{PointCloud, Scene};
use rand::Rng;

use super::base::Base;
use super::hidden::hidden;
use super::residual::{Residual, looked_at, residuals};
use crate::dataset::ImageSource;
use crate::error::TrainError;
use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

/// A pixel differs from the base from this mean absolute difference of a color on, of 1.
const DIFFERS: f32 = 0.06;
/// Differing pixels of a view for each point: densification adds what is missing.
const PIXELS_A_POINT: usize = 2;
/// Points drawn for each that is kept.
const DRAWN: usize = 20;
/// They lie between this share of the base's depth and all of it.
const NEAREST: f32 = 0.15;
/// A point is before the base up to this factor of its depth.
const BEFORE: f32 = 1.02;
/// From this number of cameras at a time on, each time is judged alone.
const RIG: usize = 3;
/// A start has at least this number of points, also where nothing moves.
const LEAST: usize = 50;

/// The beginning of a segment.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// Gaussians of the base that are hidden, rising.
    pub hidden: Vec<u32>,
    /// Where the segment's own Gaussians begin.
    pub points: PointCloud,
}

impl Start {
    /// The start of a segment whose frames are `data`, with about `count` points. `device` is one without autodiff.
    ///
    /// # Errors
    /// [`TrainError::Data`] for an image that cannot be read.
    pub fn of(
        base: &Base,
        data: &Scene,
        images: &dyn ImageSource,
        count: usize,
        seed: u64,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let frames = looked_at(data);
        let before = residuals(base.gaussians(), &frames, data.background, images, device)?;
        let hidden = hidden(base.gaussians(), &before, device);
        let shown = base.without(&hidden)?;
        let residuals = if hidden.is_empty() {
            before
        } else {
            // They are large.
            drop(before);
            residuals(&shown, &frames, data.background, images, device)?
        };
        Ok(Self { hidden, points: points(&residuals, data, count.max(LEAST), seed) })
    }
}

/// A point that may be the place of something.
struct Candidate {
    place: Vec3,
    color: [f32; 3],
    share: f32,
}

fn points(residuals: &[Residual<'_>], data: &Scene, count: usize, seed: u64) -> PointCloud {
    let differing: Vec<[u32; 2]> = residuals
        .iter()
        .enumerate()
        .flat_map(|(view, residual)| {
            let pixels = residual.error.iter().enumerate().filter(|(_, error)| **error >= DIFFERS);
            pixels.map(move |(pixel, _)| [view as u32, pixel as u32])
        })
        .collect();
    let mut random = generator(seed, Purpose::GuidedSampling, Stage::Coarse, 0);
    let mut candidates: Vec<Candidate> = Vec::new();
    let by_time = by_time(residuals);
    // As many as the differing area of a view is worth: small things need few Gaussians.
    let count = count.min(differing.len() / (PIXELS_A_POINT * residuals.len().max(1))).max(LEAST);
    let draws = if differing.is_empty() { 0 } else { DRAWN * count };
    for _ in 0..draws {
        let [view, pixel] = differing[random.random_range(0..differing.len())].map(|index| index as usize);
        let residual = &residuals[view];
        let camera = &residual.frame.camera;
        let far = if residual.depth[pixel].is_finite() { residual.depth[pixel] } else { 2.0 * data.extent };
        let z = far * random.random_range(NEAREST..1.0);
        let width = camera.width as usize;
        let [u, v] = [pixel % width, pixel / width].map(|place| place as f32 + 0.5);
        let seen = Vec3::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0) * z;
        let place = camera.rotation.transpose() * (seen - camera.translation);
        let color = std::array::from_fn(|channel| f32::from(residual.truth.pixels[3 * pixel + channel]) / 255.0);
        let views = by_time.get(&residual.frame.time.to_bits()).filter(|views| views.len() >= RIG);
        let share = match views {
            Some(views) => share_differing(place, views.iter().map(|view| &residuals[*view])),
            None => share_differing(place, residuals.iter()),
        };
        candidates.push(Candidate { place, color, share });
    }
    candidates.sort_by(|a, b| b.share.total_cmp(&a.share));
    candidates.truncate(count);
    if candidates.len() < LEAST {
        // Nothing moves: some points of the scene, which will be pruned.
        let take = LEAST.min(data.points.len());
        let stride = (data.points.len() / take.max(1)).max(1);
        let some = |values: &[[f32; 3]]| values.iter().copied().step_by(stride).take(take).collect();
        return PointCloud { positions: some(&data.points.positions), colors: some(&data.points.colors) };
    }
    PointCloud {
        positions: candidates.iter().map(|candidate| candidate.place.to_array()).collect(),
        colors: candidates.iter().map(|candidate| candidate.color).collect(),
    }
}

/// The views of each time, by the bits of the time.
fn by_time(residuals: &[Residual<'_>]) -> BTreeMap<u32, Vec<usize>> {
    let mut by_time = BTreeMap::<u32, Vec<usize>>::new();
    for (view, residual) in residuals.iter().enumerate() {
        by_time.entry(residual.frame.time.to_bits()).or_default().push(view);
    }
    by_time
}

/// The share of the views which see a place, before the base, at a pixel that differs; a view whose base hides the place speaks
/// against it.
fn share_differing<'a>(place: Vec3, views: impl Iterator<Item = &'a Residual<'a>>) -> f32 {
    let (mut differ, mut seen) = (0, 0);
    for Residual { frame, error, depth, .. } in views {
        let camera = &frame.camera;
        let (u, v, z) = camera.project(place);
        let inside = |value: f32, size: u32| value >= 0.0 && value < size as f32;
        if z <= 0.0 || !inside(u, camera.width) || !inside(v, camera.height) {
            continue;
        }
        let pixel = v as usize * camera.width as usize + u as usize;
        seen += 1;
        differ += usize::from(z <= BEFORE * depth[pixel] && error[pixel] >= DIFFERS);
    }
    // A place that hardly any view sees is not proved by them.
    differ as f32 / seen.max(2) as f32
}
