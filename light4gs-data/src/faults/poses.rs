//! What poses and points say.

use crate::posing::{LEAST_PARALLAX, LEAST_REGISTERED, parallax as parallax_of};
use crate::scene::Scene;

/// With a smaller parallax, in degrees, depths are coarse.
const GOOD_PARALLAX: f64 = 10.0;
/// Cameras that are looked at, of more of them.
const MOST_CAMERAS: usize = 512;

/// Few images with a pose.
pub(super) fn unposed(scene: &Scene) -> Option<String> {
    let used: usize = [&scene.train, &scene.test, &scene.val].into_iter().map(Vec::len).sum();
    let all = used + scene.reading.unposed;
    let share = used as f64 / all as f64;
    (share < LEAST_REGISTERED).then(|| {
        format!(
            "{used} of {all} images have a pose: where poses break off, those at the edges are poor, too; film more slowly \
             and with texture in the background, or take more frames of the video"
        )
    })
}

/// Cameras all in one place, or nearly so.
pub(super) fn parallax(scene: &Scene) -> Option<String> {
    let cameras = || scene.train.iter().chain(&scene.test);
    let count = cameras().count();
    let centers: Vec<_> =
        cameras().step_by(count.div_ceil(MOST_CAMERAS).max(1)).map(|frame| frame.camera.center().as_dvec3()).collect();
    let parallax = parallax_of(&centers, &scene.points.positions);
    if parallax < LEAST_PARALLAX {
        return Some(format!(
            "all cameras are in one place ({parallax:.1} degrees of parallax): images that differ by turns alone show no \
             depth; walk sideways around the scene, or film with several cameras"
        ));
    }
    (parallax < GOOD_PARALLAX).then(|| {
        format!(
            "there is little parallax ({parallax:.1} degrees, {GOOD_PARALLAX} are good): depths are coarse, and views from \
             elsewhere will be poor; walk farther around the scene"
        )
    })
}
