//! How coarsely positions, scales, rotations, opacities and constant colors may be quantized.
//!
//! The error that an attribute's step puts into the images grows with its square, and a halved step costs a bit for
//! each number. So for a given error in total the file is smallest when every number of every attribute brings the
//! same share of it. One rendering an attribute tells how sensitive the images are to it; the steps follow from that.

use light4gs_codec::attributes::{AttributeSteps, quantized};
use light4gs_codec::{CodecError, SceneData};

/// Numbers a Gaussian: position, scales, quaternion, opacity, color.
const NUMBERS: [f64; 5] = [3.0, 3.0, 4.0, 1.0, 3.0];
/// Other attributes are left almost exact, at this share of their given step, while one is looked at.
const ALMOST_EXACT: f32 = 1.0 / 64.0;
/// A step grows by this factor at most: the squared-error model holds for small errors.
const LARGEST_GROWTH: f64 = 4.0;
/// A step shrinks to this share of itself at most.
const LARGEST_SHRINKAGE: f64 = 1.0 / 64.0;
/// Corrections of all steps together, after a look at what they really do.
const CORRECTIONS: usize = 3;

fn to_array(steps: &AttributeSteps) -> [f32; 5] {
    let AttributeSteps { position, log_scale, quaternion, opacity_logit, sh_dc } = *steps;
    [position, log_scale, quaternion, opacity_logit, sh_dc]
}

fn from_array([position, log_scale, quaternion, opacity_logit, sh_dc]: [f32; 5]) -> AttributeSteps {
    // What the search tries must be something that the encoder takes.
    AttributeSteps { position, log_scale, quaternion, opacity_logit, sh_dc }.clamped()
}

/// Steps that cost at most about `tolerance` dB on the images that `render` makes, starting from `given`.
///
/// `render` gives the same views of any scene, as one list of pixel values; `error` is the mean squared error of those
/// of the scene as it is. Spherical harmonics are left out: they have a step of their own, and hardly matter to how
/// sensitive the images are to the rest.
pub(super) fn search(
    scene: &SceneData,
    given: &AttributeSteps,
    tolerance: f64,
    error: f64,
    render: &dyn Fn(&SceneData) -> Vec<f32>,
) -> Result<AttributeSteps, CodecError> {
    let mut scene = scene.clone();
    scene.gaussians.sh_degree = 0;
    scene.gaussians.sh_rest = Vec::new();
    let exact = render(&scene);
    let distortion = |steps: &AttributeSteps| -> Result<f64, CodecError> {
        let images = render(&SceneData { gaussians: quantized(&scene.gaussians, steps)?, ..scene.clone() });
        let sum: f64 = images.iter().zip(&exact).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        Ok(sum / exact.len().max(1) as f64)
    };
    let budget = error * (10f64.powf(tolerance / 10.0) - 1.0);
    let start = to_array(given);
    let mut steps = start;
    for attribute in 0..start.len() {
        let mut alone = start.map(|step| step * ALMOST_EXACT);
        alone[attribute] = start[attribute];
        let share = budget * NUMBERS[attribute] / NUMBERS.iter().sum::<f64>();
        let factor = (share / distortion(&from_array(alone))?.max(f64::MIN_POSITIVE)).sqrt();
        steps[attribute] = start[attribute] * factor.clamp(LARGEST_SHRINKAGE, LARGEST_GROWTH) as f32;
    }
    for _ in 0..CORRECTIONS {
        let found = distortion(&from_array(steps))?;
        if found <= budget {
            break;
        }
        let factor = (budget / found).sqrt().max(0.5) as f32;
        steps = steps.map(|step| step * factor);
    }
    Ok(from_array(steps))
}

#[cfg(test)]
mod tests {
    use light4gs_codec::GaussianArrays;

    use super::*;

    fn scene() -> SceneData {
        let random = |i: usize| ((i as f32 * 12.9898).sin() * 43_758.547).fract();
        let triple = |i: usize| [random(3 * i), random(3 * i + 1), random(3 * i + 2)];
        let gaussians = GaussianArrays {
            // Along the diagonal, so that quantizing leaves the order as it is.
            means: (0..500).map(|i| [i as f32; 3]).collect(),
            log_scales: (0..500).map(|i| triple(i).map(|v| v - 4.0)).collect(),
            quats: (0..500).map(|i| [1.0, random(i), random(i + 1), random(i + 2)]).collect(),
            opacity_logits: (0..500).map(random).collect(),
            sh_dc: (0..500).map(triple).collect(),
            ..GaussianArrays::default()
        };
        SceneData { gaussians, ..SceneData::default() }
    }

    /// "Images" that are ten times as sensitive to opacities as to colors, and to nothing else.
    fn images(scene: &SceneData) -> Vec<f32> {
        let GaussianArrays { sh_dc, opacity_logits, .. } = &scene.gaussians;
        let opacities = opacity_logits.iter().map(|logit| 10.0 * logit);
        sh_dc.as_flattened().iter().copied().chain(opacities).collect()
    }

    #[test]
    fn sensitive_attributes_get_finer_steps() {
        let given = AttributeSteps { position: 1e-4, opacity_logit: 0.02, sh_dc: 0.02, ..AttributeSteps::default() };
        let steps = search(&scene(), &given, 0.1, 1e-3, &images).unwrap();
        assert!(steps.opacity_logit < 0.5 * steps.sh_dc, "{steps:?}");
        // The images do not see scales and rotations at all.
        assert_eq!(steps.log_scale, given.log_scale * LARGEST_GROWTH as f32);
        assert_eq!(steps.quaternion, given.quaternion * LARGEST_GROWTH as f32);
    }

    #[test]
    fn a_smaller_tolerance_gives_finer_steps() {
        let given = AttributeSteps { position: 1e-4, opacity_logit: 0.02, sh_dc: 0.02, ..AttributeSteps::default() };
        let at = |tolerance| search(&scene(), &given, tolerance, 1e-3, &images).unwrap();
        assert!(at(0.02).opacity_logit < at(0.2).opacity_logit);
    }
}
