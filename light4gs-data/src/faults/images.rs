//! What the images say.

use super::median;
use crate::curves::CameraCurve;
use crate::scene::Scene;

/// An image with a smaller share of the sharpness that is usual around it is blurred.
const BLURRED: f32 = 0.75;
/// Images before and after one that tell what is usual.
const AROUND: usize = 4;
/// Images next to each other show about the same if they differ by a smaller share of what images far apart do.
const RUNS_ON: f32 = 0.7;
/// If a larger share of the images is blurred, it is worth a word.
const BLURRED_SHARE: f64 = 0.05;
/// With less sharpness than this, all detail is in an image of half the size: a blur of two pixels and more.
const LEAST_SHARPNESS: f32 = 0.085;
/// A larger change of a gain's logarithm from one image to the next is a jump.
const JUMP: f32 = 0.04;
/// Motion is too fast if images next to each other differ by a larger share of what images far apart do.
const TOO_FAST: f32 = 0.85;
/// Changes below this are noise.
const NOISE: f32 = 0.003;
/// The fewest images from which motion is judged.
const LEAST_IMAGES: usize = 8;

/// Images whose whole detail is in a smaller image.
pub(super) fn soft(scene: &Scene, curves: &[CameraCurve]) -> Option<String> {
    let usual = median(curves.iter().flat_map(|curve| curve.sharpness.iter().copied()))?;
    let camera = &scene.train.first()?.camera;
    let half = camera.width.max(camera.height) / 2;
    (usual < LEAST_SHARPNESS).then(|| {
        format!(
            "the images have no detail at the size at which they are used (sharpness {usual:.3}, {LEAST_SHARPNESS} and more \
             are good): they are out of focus or were enlarged; --pixels {half} has all of it, in less time"
        )
    })
}

/// The median change from one image to the next, as a share of that between images far apart.
fn pace(curve: &CameraCurve) -> Option<f32> {
    Some(median(curve.changes.iter().copied())? / curve.far_change)
}

/// Whether images next to each other show about the same, so that their sharpness can be compared.
fn runs_on(curve: &&CameraCurve) -> bool {
    curve.still || pace(curve).is_some_and(|pace| pace < RUNS_ON)
}

/// Images that are less sharp than those before and after them.
pub(super) fn blurred(curves: &[CameraCurve]) -> Option<String> {
    let mut all = 0;
    let mut blurred = 0;
    let mut worst: Option<(f32, String)> = None;
    for curve in curves.iter().filter(runs_on) {
        all += curve.sharpness.len();
        for (k, sharpness) in curve.sharpness.iter().enumerate() {
            let around = k.saturating_sub(AROUND)..(k + AROUND + 1).min(curve.sharpness.len());
            let Some(usual) = median(curve.sharpness[around].iter().copied()) else { continue };
            let share = sharpness / usual;
            if share < BLURRED {
                blurred += 1;
                if worst.as_ref().is_none_or(|(least, _)| share < *least) {
                    worst = Some((share, format!("camera {}, time {:.3}", curve.name, curve.times[k])));
                }
            }
        }
    }
    let (_, worst) = worst?;
    (blurred > 1 && f64::from(blurred) > BLURRED_SHARE * all as f64).then(|| {
        format!(
            "{blurred} of {all} images that were looked at are blurred, compared with those around them (most: {worst}): they \
             blur the scene; remove them, or film more slowly and in better light"
        )
    })
}

/// Exposure that jumps from one image of a camera to the next.
pub(super) fn exposure(curves: &[CameraCurve]) -> Option<String> {
    let gains = || curves.iter().flat_map(|curve| curve.log_gains.iter().map(|gain| gain.abs()));
    let (jumps, all) = (gains().filter(|gain| *gain > JUMP).count(), gains().count());
    let most = gains().fold(0.0, f32::max);
    (jumps > 1).then(|| {
        format!(
            "the exposure jumps {jumps} times in {all} pairs of images, by up to {:.0} %: --set 'train.exposure=\"frame\"' \
             learns a gain for each image; lock the exposure when you film",
            100.0 * most.exp_m1()
        )
    })
}

/// Motion that is over before the next image, where the camera stands still.
pub(super) fn fast(curves: &[CameraCurve]) -> Option<String> {
    let jumps = |curve: &CameraCurve| curve.log_gains.iter().any(|gain| gain.abs() > JUMP);
    let judged = |curve: &&CameraCurve| {
        curve.still
            && curve.every == 1
            && curve.times.len() >= LEAST_IMAGES
            && curve.far_change > NOISE
            && !jumps(curve)
    };
    let usual = median(curves.iter().filter(judged).filter_map(pace))?;
    (usual > TOO_FAST).then(|| {
        format!(
            "things move too fast for the rate: from one image to the next they differ by {:.0} % of what images far apart do; \
             record with more frames per second, or take more frames of the video",
            100.0 * usual
        )
    })
}
