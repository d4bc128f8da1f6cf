//! How much each camera's image changes from one time to the next.

use crate::error::DataError;
use crate::frame::Frame;
use crate::images::{ImageStore, RgbImage8};
use crate::scene::Scene;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Images are compared at about this many pixels on the longer side: noise and compression disappear.
const SIDE: u32 = 64;

/// How much the image of a camera changes from each of its times to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeCurve {
    /// See [`Frame::camera_id`].
    pub camera_id: u32,
    /// The folder of the camera's images, or the name of its first frame.
    pub name: String,
    /// `[K]`: the later time of each pair.
    pub times: Vec<f32>,
    /// `[K]`: mean absolute difference of gray values, in `[0, 1]`.
    pub changes: Vec<f32>,
}

/// The curves of all cameras over the same stretch of time from the first frame on, so that no more than `most` images
/// are decoded, by camera. A camera with less than two frames has none.
///
/// # Errors
/// [`DataError::Image`] if an image cannot be decoded.
pub fn change_curves(scene: &Scene, store: &ImageStore, most: usize) -> Result<Vec<ChangeCurve>, DataError> {
    let mut cameras: BTreeMap<u32, Vec<&Frame>> = BTreeMap::new();
    for frame in scene.train.iter().chain(&scene.test).filter(|frame| frame.has_image()) {
        cameras.entry(frame.camera_id).or_default().push(frame);
    }
    let each = (most / cameras.len().max(1)).max(2);
    let mut cameras: Vec<Vec<&Frame>> = cameras.into_values().filter(|frames| frames.len() > 1).collect();
    for frames in &mut cameras {
        frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        frames.truncate(each);
    }
    cameras.iter().map(|frames| curve(frames, store)).collect()
}

fn curve(frames: &[&Frame], store: &ImageStore) -> Result<ChangeCurve, DataError> {
    let small: Vec<Vec<f32>> =
        frames.par_iter().map(|frame| Ok(thumbnail(&*store.get(frame)?))).collect::<Result<_, DataError>>()?;
    let change = |pair: &[Vec<f32>]| {
        let sum: f32 = pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).sum();
        sum / pair[0].len().min(pair[1].len()).max(1) as f32
    };
    let folder = frames[0].path.parent().and_then(|parent| parent.file_name());
    Ok(ChangeCurve {
        camera_id: frames[0].camera_id,
        name: folder.map_or_else(|| frames[0].name.clone(), |name| name.to_string_lossy().into_owned()),
        times: frames[1..].iter().map(|frame| frame.time).collect(),
        changes: small.windows(2).map(change).collect(),
    })
}

/// Gray values in `[0, 1]` of blocks of pixels.
fn thumbnail(image: &RgbImage8) -> Vec<f32> {
    let factor = image.width.max(image.height).div_ceil(SIDE).max(1);
    let factor = factor.min(image.width.min(image.height).max(1));
    let reduced = image.reduced(factor);
    reduced.pixels.chunks_exact(3).map(|rgb| rgb.iter().map(|v| f32::from(*v)).sum::<f32>() / 765.0).collect()
}
