//! Values that other programs show, but that would cost all others their precision in a file: an opacity of exactly 1, a scale
//! of 0, a Gaussian at a distance of 10^9. Each is moved to where the image stays the same.

use glam::DVec3;
use light4gs_codec::GaussianArrays;

use super::extent::Extent;

/// A logit beyond this is an opacity of 0 or 1 for a float32.
const MOST_LOGIT: f32 = 20.0;
/// Harmonics beyond this are far brighter than white.
const MOST_COLOR: f32 = 1e3;
/// Radii of the scene: what is farther away shows no parallax.
const FARTHEST: f64 = 1e3;
/// Standard deviations beyond this many radii of the scene are as good as endless.
const LARGEST: f64 = 1e3;
/// Those below this many radii are far below a pixel.
const SMALLEST: f64 = 1e-6;

/// Bounds values without NaN, and makes quaternions of unit length. Says what has been changed, one sentence for each
/// kind; unit length is not worth one.
pub(super) fn bound(gaussians: &mut GaussianArrays) -> Vec<String> {
    let extent = Extent::of(gaussians);
    let kinds = [
        (bound_opacities(gaussians), format!("an opacity of 0 or 1, or nearly: kept, with a logit of ±{MOST_LOGIT}")),
        (
            bound_distances(gaussians, &extent),
            format!("a distance of more than {FARTHEST} radii of the scene: moved there, and made smaller by as much"),
        ),
        (
            bound_scales(gaussians, &extent),
            format!(
                "a scale of 0, or of less than {SMALLEST:e} or more than {LARGEST} radii of the scene: kept, with that scale"
            ),
        ),
        (bound_colors(gaussians), format!("a color beyond ±{MOST_COLOR}: kept, with that color")),
        (normalize(gaussians), "a quaternion of length 0: kept, without a rotation".to_owned()),
    ];
    let found = kinds.into_iter().filter(|(count, _)| *count > 0);
    let verb = |count: usize| if count == 1 { "has" } else { "have" };
    found.map(|(count, kind)| format!("{count} of {} Gaussians {} {kind}", gaussians.len(), verb(count))).collect()
}

/// Makes infinite logits and scales finite, for a model whose Gaussians must stay where they are.
pub(super) fn make_finite(gaussians: &mut GaussianArrays) {
    bound_opacities(gaussians);
    let scales = gaussians.log_scales.as_flattened_mut();
    // Far below what a float32 adds to anything.
    scales.iter_mut().filter(|log| **log == f32::NEG_INFINITY).for_each(|log| *log = -40.0);
}

fn bound_opacities(gaussians: &mut GaussianArrays) -> usize {
    gaussians.opacity_logits.iter_mut().filter_map(|logit| bounded(logit, -MOST_LOGIT, MOST_LOGIT)).count()
}

fn bound_distances(gaussians: &mut GaussianArrays, extent: &Extent) -> usize {
    let most = FARTHEST * extent.radius;
    let mut count = 0;
    for (mean, log_scales) in gaussians.means.iter_mut().zip(&mut gaussians.log_scales) {
        let offset = DVec3::from_array(mean.map(f64::from)) - extent.center;
        let nearer = most / offset.length();
        if nearer < 1.0 {
            *mean = (extent.center + offset * nearer).as_vec3().to_array();
            *log_scales = log_scales.map(|log| log + nearer.ln() as f32);
            count += 1;
        }
    }
    count
}

fn bound_scales(gaussians: &mut GaussianArrays, extent: &Extent) -> usize {
    let [least, most] = [SMALLEST, LARGEST].map(|radii| (radii * extent.radius).ln() as f32);
    let any = |log_scales: &mut [f32; 3]| log_scales.iter_mut().filter_map(|log| bounded(log, least, most)).count() > 0;
    gaussians.log_scales.iter_mut().map(any).filter(|any| *any).count()
}

fn bound_colors(gaussians: &mut GaussianArrays) -> usize {
    let per_gaussian = gaussians.sh_rest.len() / gaussians.len().max(1);
    let mut count = 0;
    for (i, dc) in gaussians.sh_dc.iter_mut().enumerate() {
        let rest = &mut gaussians.sh_rest[i * per_gaussian..(i + 1) * per_gaussian];
        let all = dc.iter_mut().chain(rest);
        count += usize::from(all.filter_map(|value| bounded(value, -MOST_COLOR, MOST_COLOR)).count() > 0);
    }
    count
}

/// Makes quaternions of unit length, and counts those of length 0.
fn normalize(gaussians: &mut GaussianArrays) -> usize {
    let mut without = 0;
    for quat in &mut gaussians.quats {
        // The squares of large components are infinite in float32.
        let wide = quat.map(f64::from);
        let length = wide.iter().map(|q| q * q).sum::<f64>().sqrt();
        if length > 0.0 {
            *quat = wide.map(|q| (q / length) as f32);
        } else {
            *quat = [1.0, 0.0, 0.0, 0.0];
            without += 1;
        }
    }
    without
}

/// Moves a value to the nearer bound if it is beyond.
fn bounded(value: &mut f32, least: f32, most: f32) -> Option<()> {
    let nearest = value.clamp(least, most);
    let beyond = *value != nearest;
    *value = nearest;
    beyond.then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordinary() -> GaussianArrays {
        let value = |i: usize, k: usize| ((i * 31 + k * 17) % 23) as f32 / 12.0 - 0.9;
        GaussianArrays {
            means: (0..30).map(|i| [0, 1, 2].map(|k| value(i, k))).collect(),
            log_scales: (0..30).map(|i| [3, 4, 5].map(|k| value(i, k) - 3.0)).collect(),
            quats: (0..30).map(|i| [6, 7, 8, 9].map(|k| value(i, k))).collect(),
            opacity_logits: (0..30).map(|i| 3.0 * value(i, 10)).collect(),
            sh_dc: (0..30).map(|i| [11, 12, 13].map(|k| value(i, k))).collect(),
            ..GaussianArrays::default()
        }
    }

    #[test]
    fn ordinary_values_stay() {
        let (before, mut after) = (ordinary(), ordinary());
        assert_eq!(bound(&mut after), [""; 0]);
        after.quats.clone_from(&before.quats);
        assert_eq!(after, before);
    }

    #[test]
    fn values_of_other_programs_are_kept_and_said() {
        let mut gaussians = ordinary();
        gaussians.opacity_logits[..3].copy_from_slice(&[f32::INFINITY, f32::NEG_INFINITY, 1e30]);
        gaussians.log_scales[3][1] = f32::NEG_INFINITY;
        gaussians.log_scales[4] = [1e30; 3];
        gaussians.sh_dc[5][2] = -1e30;
        gaussians.quats[6] = [0.0; 4];
        gaussians.quats[7] = [3e38, 3e38, 3e38, 3e38];
        gaussians.quats[8] = [0.0, 1e-30, 0.0, 0.0];
        let before = gaussians.clone();
        let notes = bound(&mut gaussians).join("\n");
        for expected in [
            "3 of 30 Gaussians have an opacity",
            "2 of 30 Gaussians have a scale",
            "1 of 30 Gaussians has a color",
            "1 of 30 Gaussians has a quaternion",
        ] {
            assert!(notes.contains(expected), "{notes}");
        }
        assert_eq!(gaussians.opacity_logits[..3], [20.0, -20.0, 20.0]);
        assert!(gaussians.log_scales.as_flattened().iter().all(|log| (-20.0..10.0).contains(log)));
        assert_eq!(
            (gaussians.log_scales[3][0], gaussians.log_scales[3][2]),
            (before.log_scales[3][0], before.log_scales[3][2])
        );
        assert_eq!(gaussians.sh_dc[5], [before.sh_dc[5][0], before.sh_dc[5][1], -1e3]);
        assert_eq!(gaussians.quats[6..9], [[1.0, 0.0, 0.0, 0.0], [0.5; 4], [0.0, 1.0, 0.0, 0.0]]);
    }

    /// Seen from the scene, it stays in its direction, and has its size.
    #[test]
    fn what_is_far_away_comes_nearer_and_looks_the_same() {
        let mut gaussians = ordinary();
        gaussians.means[3] = [3e20, -4e20, 0.0];
        gaussians.log_scales[3] = [44.0, 43.0, 42.0];
        let extent = Extent::of(&gaussians);
        let notes = bound(&mut gaussians);
        assert!(notes.len() == 1 && notes[0].starts_with("1 of 30 Gaussians has a distance"), "{notes:?}");
        let offset = DVec3::from_array(gaussians.means[3].map(f64::from)) - extent.center;
        assert!((offset.length() / (1e3 * extent.radius) - 1.0).abs() < 1e-5, "{offset}");
        assert!(offset.normalize().abs_diff_eq(DVec3::new(0.6, -0.8, 0.0), 1e-6), "{offset}");
        let angle = (f64::from(gaussians.log_scales[3][0]) - offset.length().ln()).exp();
        assert!((angle / (44f64.exp() / 5e20) - 1.0).abs() < 1e-4, "{angle}");
    }
}
