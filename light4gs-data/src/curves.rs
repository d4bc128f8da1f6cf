//! What the images of each camera are like over time: how sharp they are, how much they change, and by what gain.

use crate::error::DataError;
use crate::frame::Frame;
use crate::images::{ImageStore, RgbImage8};
use crate::scene::Scene;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Images are compared at about this many pixels on the longer side: noise and compression disappear.
const SIDE: u32 = 64;
/// What detail is compared with: an image of this fraction of the size.
const COARSE: u32 = 4;
/// Pixels that are darker say nothing about a gain.
const DARK: f32 = 0.05;
/// A gain explains a change if what it leaves is a smaller share of the change than this.
const LEFT_BY_A_GAIN: f32 = 0.7;

/// The images of a camera over time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CameraCurve {
    /// See [`Frame::camera_id`].
    pub camera_id: u32,
    /// The folder of the camera's images in the dataset, or the name of its first frame.
    pub name: String,
    /// `[K]`: of each image, rising.
    pub times: Vec<f32>,
    /// `[K]`: how much detail an image has at the size at which it is used: the mean square of the difference of
    /// neighboring pixels, as a share of the same in the image at a quarter of the size. A sixteenth without any, a quarter
    /// for hard edges, more for fine texture and for noise. NaN for an image without edges.
    pub sharpness: Vec<f32>,
    /// `[K - 1]`: mean absolute difference of gray values from each image to the next, in `[0, 1]`.
    pub changes: Vec<f32>,
    /// `[K - 1]`: the logarithm of the gain that explains most of this difference; 0 if none does.
    pub log_gains: Vec<f32>,
    /// Mean absolute difference of gray values between images that are half of all apart, in `[0, 1]`.
    pub far_change: f32,
    /// Every n-th image of the camera is looked at.
    pub every: usize,
    /// Whether the camera stands still.
    pub still: bool,
}

/// The curves of all cameras, by camera, from at most about `most` images. Of a rig these are the same stretch of time from
/// the first frame on, so that cameras can be compared; of a single camera every n-th image. A camera with less than two
/// images has none.
///
/// # Errors
/// [`DataError::Image`] if an image cannot be decoded.
pub fn camera_curves(scene: &Scene, store: &ImageStore, most: usize) -> Result<Vec<CameraCurve>, DataError> {
    let mut cameras: BTreeMap<u32, Vec<&Frame>> = BTreeMap::new();
    for frame in scene.train.iter().chain(&scene.test).filter(|frame| frame.has_image()) {
        cameras.entry(frame.camera_id).or_default().push(frame);
    }
    let each = (most / cameras.len().max(1)).max(2);
    let mut cameras: Vec<Vec<&Frame>> = cameras.into_values().filter(|frames| frames.len() > 1).collect();
    for frames in &mut cameras {
        frames.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
    if let [frames] = &cameras[..] {
        let every = frames.len().div_ceil(each);
        let chosen: Vec<&Frame> = frames.iter().copied().step_by(every).collect();
        return Ok(vec![curve(&chosen, every, &scene.root, store)?]);
    }
    cameras.iter().map(|frames| curve(&frames[..frames.len().min(each)], 1, &scene.root, store)).collect()
}

fn curve(frames: &[&Frame], every: usize, root: &Path, store: &ImageStore) -> Result<CameraCurve, DataError> {
    let look = |frame: &&Frame| {
        let image = store.get(frame)?;
        Ok((gray(&image.reduced(block(&image))), sharpness(&image)))
    };
    let (small, sharpness): (Vec<Vec<f32>>, Vec<f32>) =
        frames.par_iter().map(look).collect::<Result<Vec<_>, DataError>>()?.into_iter().unzip();
    let half = small.len() / 2;
    let far = small.iter().zip(&small[half..]).map(|(a, b)| change(a, b));
    let first = frames[0];
    let pose = |frame: &Frame| (frame.camera.rotation, frame.camera.translation);
    Ok(CameraCurve {
        camera_id: first.camera_id,
        name: name_of(first, root),
        times: frames.iter().map(|frame| frame.time).collect(),
        sharpness,
        changes: small.windows(2).map(|pair| change(&pair[0], &pair[1])).collect(),
        log_gains: small.windows(2).map(|pair| log_gain(&pair[0], &pair[1])).collect(),
        far_change: far.sum::<f32>() / (small.len() - half) as f32,
        every,
        still: frames.iter().all(|frame| pose(frame) == pose(first)),
    })
}

/// The folder of a camera's images in the dataset, without a last folder `images`, or the frame's name.
fn name_of(frame: &Frame, root: &Path) -> String {
    let folder = frame.path.parent().and_then(|folder| folder.strip_prefix(root).ok());
    let folder =
        folder.map(|folder| if folder.ends_with("images") { folder.parent().unwrap_or(folder) } else { folder });
    match folder.map(|folder| folder.display().to_string()) {
        Some(name) if !name.is_empty() => name,
        _ => frame.name.clone(),
    }
}

/// The side of the blocks of pixels that become one.
fn block(image: &RgbImage8) -> u32 {
    let longer = image.width.max(image.height);
    longer.div_ceil(SIDE).clamp(1, image.width.min(image.height).max(1))
}

/// Gray values in `[0, 1]`.
fn gray(image: &RgbImage8) -> Vec<f32> {
    image.pixels.chunks_exact(3).map(|rgb| rgb.iter().map(|value| f32::from(*value)).sum::<f32>() / 765.0).collect()
}

/// Mean absolute difference of gray values.
fn change(a: &[f32], b: &[f32]) -> f32 {
    let sum: f32 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
    sum / a.len().min(b.len()).max(1) as f32
}

/// The logarithm of the median ratio of gray values, if it explains most of what changes from `a` to `b`, otherwise 0.
fn log_gain(a: &[f32], b: &[f32]) -> f32 {
    let mut ratios: Vec<f32> = a.iter().zip(b).filter(|(a, b)| **a > DARK && **b > DARK).map(|(a, b)| b / a).collect();
    ratios.sort_by(f32::total_cmp);
    // Where most of the image is dark, the rest may be what moves.
    if 2 * ratios.len() < a.len() {
        return 0.0;
    }
    let Some(gain) = ratios.get(ratios.len() / 2) else { return 0.0 };
    let brighter: Vec<f32> = a.iter().map(|value| (gain * value).min(1.0)).collect();
    if change(&brighter, b) < LEFT_BY_A_GAIN * change(a, b) { gain.ln() } else { 0.0 }
}

/// See [`CameraCurve::sharpness`].
fn sharpness(image: &RgbImage8) -> f32 {
    if image.width.min(image.height) < 2 * COARSE {
        return f32::NAN;
    }
    let coarse = image.reduced(COARSE);
    squared_differences(&gray(image), image.width) / squared_differences(&gray(&coarse), coarse.width)
}

/// The mean square of the difference of neighbors, across and along.
fn squared_differences(gray: &[f32], width: u32) -> f32 {
    let width = width as usize;
    let square = |(a, b): (&f32, &f32)| f64::from((a - b) * (a - b));
    let across: f64 = gray.chunks_exact(width).map(|row| row.iter().zip(&row[1..]).map(square).sum::<f64>()).sum();
    let along: f64 = gray.iter().zip(&gray[width..]).map(square).sum();
    ((across + along) / gray.len() as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vertical stripes, 32 pixels wide, whose edges are ramps of `ramp` pixels.
    fn stripes(ramp: f32, gain: f32) -> RgbImage8 {
        let value = |x: u32| {
            let phase = (x % 64) as f32 - 32.5;
            let up = ((phase + 16.0) / ramp + 0.5).clamp(0.0, 1.0) - ((phase - 16.0) / ramp + 0.5).clamp(0.0, 1.0);
            (gain * (40.0 + 160.0 * up)).round() as u8
        };
        let pixels = (0..96).flat_map(|_| (0..128).flat_map(move |x| [value(x); 3])).collect();
        RgbImage8 { width: 128, height: 96, pixels }
    }

    #[test]
    fn sharpness_falls_with_the_width_of_edges() {
        let of = |ramp| sharpness(&stripes(ramp, 1.0));
        let [hard, soft, softest] = [0.5, 4.0, 16.0].map(of);
        assert!(hard > 0.15 && soft < 0.6 * hard && softest < 0.07, "{hard} {soft} {softest}");
        let flat = RgbImage8 { width: 8, height: 8, pixels: vec![7; 192] };
        assert!(sharpness(&flat).is_nan());
        assert!(sharpness(&RgbImage8 { width: 1, height: 300, pixels: vec![7; 900] }).is_nan());
    }

    #[test]
    fn a_gain_is_found_and_motion_is_none() {
        let [before, brighter] = [1.0, 1.2].map(|gain| gray(&stripes(0.5, gain).reduced(2)));
        assert!((log_gain(&before, &brighter) - 1.2f32.ln()).abs() < 0.01);
        let mut moved = before.clone();
        moved.rotate_right(8);
        assert_eq!(log_gain(&before, &moved), 0.0);
        assert_eq!(log_gain(&[0.0; 9], &[0.0; 9]), 0.0);
    }
}
