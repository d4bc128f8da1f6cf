//! Cuts: where the picture changes at once, as when the camera jumps or the light is switched.

use std::collections::BTreeMap;

use light4gs_data::{Frame, RgbImage8, Scene};

use super::plan::times;
use crate::dataset::ImageSource;
use crate::error::TrainError;

/// Cells of a picture that are compared, along each side: coarse enough for the motion of things and of the camera to be small.
const CELLS: usize = 16;
/// Mean absolute difference of a color, of 1, from which on a change may be a cut.
const LEAST: f32 = 0.04;
/// A cut changes the picture this number of times as much as the median of the frames around it.
const TIMES_THE_USUAL: f32 = 4.0;
/// Frames on each side that are around it.
const AROUND: usize = 8;

/// The numbers of the frames before which the picture of the camera with the most frames changes at once, rising. Every image of
/// that camera is read, one after the other.
///
/// # Errors
/// [`TrainError::Data`] for an image that cannot be read.
pub fn cuts(data: &Scene, images: &dyn ImageSource) -> Result<Vec<usize>, TrainError> {
    let mut cameras: BTreeMap<u32, Vec<&Frame>> = BTreeMap::new();
    for frame in data.train.iter().chain(&data.test) {
        cameras.entry(frame.camera_id).or_default().push(frame);
    }
    // The last of equal ones; which one does not matter.
    let Some(mut frames) = cameras.into_values().max_by_key(Vec::len) else { return Ok(Vec::new()) };
    frames.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut changes = Vec::new();
    let mut before: Option<Vec<f32>> = None;
    for frame in &frames {
        let cells = cells(&*images.image(frame)?);
        if let Some(before) = before.replace(cells.clone()) {
            changes.push(difference(&before, &cells));
        }
    }
    let times = times(data);
    // The first frame that any camera has after the change.
    let number = |change: usize| times.partition_point(|time| *time <= frames[change].time);
    Ok(peaks(&changes).into_iter().map(number).collect())
}

/// The changes that are far larger than those around them; change `i` lies between the frames `i` and `i + 1`.
fn peaks(changes: &[f32]) -> Vec<usize> {
    let is_peak = |&at: &usize| {
        let [from, to] = [at.saturating_sub(AROUND), (at + AROUND + 1).min(changes.len())];
        let mut others: Vec<f32> = (from..to).filter(|other| *other != at).map(|other| changes[other]).collect();
        others.sort_by(f32::total_cmp);
        let usual = others.get(others.len() / 2).copied().unwrap_or(0.0);
        changes[at] >= LEAST && changes[at] >= TIMES_THE_USUAL * usual
    };
    (0..changes.len()).filter(is_peak).collect()
}

/// Mean colors of the cells of a picture, in [0, 1].
fn cells(image: &RgbImage8) -> Vec<f32> {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut sums = vec![[0.0_f32; 4]; CELLS * CELLS];
    for (index, color) in image.pixels.as_chunks::<3>().0.iter().enumerate() {
        let (x, y) = (index % width.max(1), index / width.max(1));
        let sum = &mut sums[y * CELLS / height.max(1) * CELLS + x * CELLS / width.max(1)];
        sum.iter_mut().zip(color).for_each(|(sum, &value)| *sum += f32::from(value) / 255.0);
        sum[3] += 1.0;
    }
    sums.iter().flat_map(|[red, green, blue, count]| [red, green, blue].map(|sum| sum / count.max(1.0))).collect()
}

fn difference(before: &[f32], after: &[f32]) -> f32 {
    before.iter().zip(after).map(|(before, after)| (after - before).abs()).sum::<f32>() / after.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_is_a_cut_and_quick_motion_is_not() {
        let mut changes = vec![0.01; 60];
        changes[20] = 0.2;
        assert_eq!(peaks(&changes), [20]);
        // A fast pan, and a change that hardly shows.
        changes[30..50].fill(0.15);
        changes[10] = 0.039;
        assert_eq!(peaks(&changes), [20]);
        assert!(peaks(&[]).is_empty());
    }

    #[test]
    fn cells_are_means_of_their_pixels() {
        let pixels = (0..40 * 20).flat_map(|pixel| if pixel % 40 < 20 { [255, 0, 0] } else { [0, 0, 51] }).collect();
        let found = cells(&RgbImage8 { width: 40, height: 20, pixels });
        assert_eq!(found.len(), 3 * CELLS * CELLS);
        assert!(found[..3] == [1.0, 0.0, 0.0] && (found[3 * CELLS - 1] - 0.2).abs() < 1e-6);
        assert!((difference(&found, &vec![0.0; found.len()]) - 0.2).abs() < 1e-6);
    }
}
