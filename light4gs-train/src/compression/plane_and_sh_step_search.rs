//! The coarsest steps of planes and spherical harmonics that were trained without noise, for example by another program.
//!
//! A scene that is trained with the rate adapts to its steps. Another scene may need finer ones. Renderings show how
//! fine: the error grows with the square of the step, so the error at one step nearly tells which step to take.

use light4gs_codec::SceneData;

use super::SearchImages;
use crate::config::CompressionConfig;

/// A step grows by this factor at most: the squared-error model holds for small errors.
const LARGEST_GROWTH: f64 = 4.0;
/// A step shrinks to this share of itself at most.
const LARGEST_SHRINKAGE: f64 = 1.0 / 256.0;
/// Renderings for each search.
const LOOKS: usize = 5;
/// The search aims a little below the budget, since it has few renderings.
const MARGIN: f64 = 0.9;

/// Sets the steps of planes and harmonics to values that cost at most about their `search_tolerance` each, in dB on the
/// images; 0 leaves them unchanged.
pub(super) fn search(scene: &SceneData, settings: &mut CompressionConfig, images: &SearchImages) {
    let exact = &images.exact;
    let budget = |tolerance: f64| images.error * (10f64.powf(tolerance / 10.0) - 1.0);
    let distortion = |scene: &SceneData| {
        let rendered = (images.render)(scene);
        let sum: f64 = rendered.iter().zip(exact).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        sum / exact.len().max(1) as f64
    };
    if settings.steps.search_tolerance > 0.0 && !scene.feature_planes.planes.is_empty() {
        let (space, time) = (settings.steps.initial.space_only, settings.steps.initial.space_time);
        let factor = factor(budget(settings.steps.search_tolerance), |factor| {
            let mut rounded = scene.clone();
            for plane in &mut rounded.feature_planes.planes {
                round(&mut plane.values, factor * if plane.axes.is_space_time() { time } else { space });
            }
            distortion(&rounded)
        });
        (settings.steps.initial.space_only, settings.steps.initial.space_time) = (factor * space, factor * time);
    }
    if settings.sh.search_tolerance > 0.0 && !scene.gaussians.sh_rest.is_empty() {
        let step = settings.sh.entropy.step;
        let factor = factor(budget(settings.sh.search_tolerance), |factor| {
            let mut rounded = scene.clone();
            round(&mut rounded.gaussians.sh_rest, factor * step);
            distortion(&rounded)
        });
        settings.sh.entropy.step = factor * step;
    }
}

/// The largest factor, approximately, at which the distortion stays within a budget.
fn factor(budget: f64, distortion: impl Fn(f64) -> f64) -> f64 {
    let (mut factor, mut good) = (1.0, LARGEST_SHRINKAGE);
    for _ in 0..LOOKS {
        let found = distortion(factor);
        if found <= budget {
            good = good.max(factor);
        }
        if found <= budget && found >= budget / 2.0 {
            break;
        }
        let next = factor * (MARGIN * budget / found.max(f64::MIN_POSITIVE)).sqrt();
        factor = next.clamp(LARGEST_SHRINKAGE, LARGEST_GROWTH);
    }
    good
}

fn round(values: &mut [f32], step: f64) {
    let step = step as f32;
    values.iter_mut().for_each(|value| *value = (*value / step).round_ties_even() * step);
}

#[cfg(test)]
mod tests {
    use light4gs_codec::plane_layout::PlaneAxes;
    use light4gs_codec::{FeaturePlaneArrays, GaussianArrays, Plane};

    use super::*;

    fn scene() -> SceneData {
        let random = |i: usize| ((i as f32 * 12.9898).sin() * 43_758.547).fract();
        let plane = |axes| Plane { scale: 0, axes, height: 8, width: 8, values: (0..64).map(random).collect() };
        SceneData {
            gaussians: GaussianArrays { sh_rest: (0..450).map(random).collect(), ..GaussianArrays::default() },
            feature_planes: FeaturePlaneArrays { channels: 1, planes: PlaneAxes::ALL.map(plane).to_vec() },
            ..SceneData::default()
        }
    }

    /// "Images" that are ten times as sensitive to planes as to harmonics.
    fn render(scene: &SceneData) -> Vec<f32> {
        let planes = scene.feature_planes.planes.iter().flat_map(|plane| plane.values.iter().map(|value| 10.0 * value));
        planes.chain(scene.gaussians.sh_rest.iter().copied()).collect()
    }

    fn found(tolerance: f64, error: f64) -> CompressionConfig {
        let mut settings = CompressionConfig::default();
        (settings.steps.search_tolerance, settings.sh.search_tolerance) = (tolerance, tolerance);
        let images = SearchImages { render: &render, exact: render(&scene()), blank: false, error, psnr: &|_| Ok(0.0) };
        search(&scene(), &mut settings, &images);
        settings
    }

    #[test]
    fn steps_keep_to_the_budget() {
        let (tolerance, error) = (0.05, 1e-3);
        let settings = found(tolerance, error);
        let exact = render(&scene());
        let mut rounded = scene();
        let step = settings.steps.initial.space_only;
        rounded.feature_planes.planes.iter_mut().for_each(|plane| round(&mut plane.values, step));
        let squares: f64 = render(&rounded).iter().zip(&exact).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let budget = error * (10f64.powf(tolerance / 10.0) - 1.0);
        let distortion = squares / exact.len() as f64;
        assert!(distortion <= budget && distortion > 0.2 * budget, "{distortion} of {budget}");
        assert!(found(0.01, error).steps.initial.space_only < step);
        assert!(settings.sh.entropy.step > settings.steps.initial.space_only);
    }

    #[test]
    fn no_tolerance_leaves_the_steps_alone() {
        assert_eq!(found(0.0, 1e-3), CompressionConfig::default());
    }
}
