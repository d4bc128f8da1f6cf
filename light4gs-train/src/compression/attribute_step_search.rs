//! The coarsest steps of positions, scales, rotations, opacities and constant colors.
//!
//! The image error from an attribute's step grows with the square of the step, and halving a step takes one bit more
//! for each number. So for a given total error, the file is smallest if every number of every attribute contributes the
//! same share. One rendering for each attribute shows how sensitive the images are to it; the steps follow from that.

use light4gs_codec::attributes::{AttributeSteps, quantized};
use light4gs_codec::{AttributeValues, CodecError, SceneData};

/// While one attribute is measured, the others are nearly exact, at this share of their given steps.
const ALMOST_EXACT: f32 = 1.0 / 64.0;
/// A step grows by this factor at most: the squared-error model holds for small errors.
const LARGEST_GROWTH: f64 = 4.0;
/// A step shrinks to this share of itself at most.
const LARGEST_SHRINKAGE: f64 = 1.0 / 64.0;
/// Corrections of all steps together, after their real effect has been measured.
const CORRECTIONS: usize = 3;

/// Steps that cost at most about `tolerance` dB on the images of `render`, starting from `given`.
///
/// `render` renders the same views of any scene, as one list of pixel values; `error` is the mean squared error of
/// those of the unquantized scene. Spherical harmonics are left out: they have a step of their own, and change the
/// sensitivity to the other attributes little.
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
    // For attributes that do not show in images, images cannot tell how exact they must be.
    let searched = |attribute: &AttributeValues<'_>| !attribute.optional && given.of(attribute.name).is_some();
    let searched: Vec<AttributeValues<'_>> = scene.gaussians.attributes().filter(searched).collect();
    // The search must try only steps that the encoder accepts.
    let steps_of = |steps: &[f32]| -> AttributeSteps {
        let pairs = searched.iter().zip(steps);
        pairs.fold(given.clone(), |all, (attribute, step)| all.with(attribute.name, *step)).clamped()
    };
    let start: Vec<f32> = searched.iter().filter_map(|attribute| given.of(attribute.name)).collect();
    let numbers: f64 = searched.iter().map(|attribute| attribute.width as f64).sum();
    let mut steps = start.clone();
    for (place, attribute) in searched.iter().enumerate() {
        let mut alone: Vec<f32> = start.iter().map(|step| step * ALMOST_EXACT).collect();
        alone[place] = start[place];
        let share = budget * attribute.width as f64 / numbers;
        let factor = (share / distortion(&steps_of(&alone))?.max(f64::MIN_POSITIVE)).sqrt();
        steps[place] = start[place] * factor.clamp(LARGEST_SHRINKAGE, LARGEST_GROWTH) as f32;
    }
    for _ in 0..CORRECTIONS {
        let found = distortion(&steps_of(&steps))?;
        if found <= budget {
            break;
        }
        let factor = (budget / found).sqrt().max(0.5) as f32;
        steps.iter_mut().for_each(|step| *step *= factor);
    }
    Ok(steps_of(&steps))
}

#[cfg(test)]
pub(super) mod tests {
    use light4gs_codec::{FurtherAttribute, GaussianArrays};

    use super::*;

    /// 500 Gaussians with numbers of all kinds.
    pub(in crate::compression) fn scene() -> SceneData {
        let random = |i: usize| ((i as f32 * 12.9898).sin() * 43_758.547).fract();
        let triple = |i: usize| [random(3 * i), random(3 * i + 1), random(3 * i + 2)];
        let gaussians = GaussianArrays {
            // Along the diagonal, so that quantization does not change the order.
            means: (0..500).map(|i| [i as f32; 3]).collect(),
            log_scales: (0..500).map(|i| triple(i).map(|v| v - 4.0)).collect(),
            quats: (0..500).map(|i| [1.0, random(i), random(i + 1), random(i + 2)]).collect(),
            opacity_logits: (0..500).map(random).collect(),
            sh_dc: (0..500).map(triple).collect(),
            ..GaussianArrays::default()
        };
        SceneData { gaussians, ..SceneData::default() }
    }

    fn given() -> AttributeSteps {
        AttributeSteps::default().with("means", 1e-4).with("opacity_logits", 0.02).with("sh_dc", 0.02)
    }

    /// Attributes that do not show in the images keep their steps. For optional attributes the images cannot tell
    /// either.
    #[test]
    fn further_attributes_are_searched_unless_they_are_optional() {
        let further = |name: &str, optional| FurtherAttribute {
            name: name.into(),
            width: 1,
            values: (0..500).map(|i| (i as f32 * 0.37).sin()).collect(),
            optional,
        };
        let mut scene = scene();
        scene.gaussians.further = vec![further("seen", false), further("unseen", true), further("exact", false)];
        let given = given().with("seen", 0.02).with("unseen", 0.02);
        let images = |scene: &SceneData| scene.gaussians.further[0].values.iter().map(|value| 10.0 * value).collect();
        let steps = search(&scene, &given, 0.1, 1e-3, &images).unwrap();
        assert!(steps.of("seen").unwrap() < 0.02, "{steps:?}");
        assert_eq!((steps.of("unseen"), steps.of("exact")), (Some(0.02), None));
    }

    /// "Images" that are ten times as sensitive to opacities as to colors, and to nothing else.
    fn images(scene: &SceneData) -> Vec<f32> {
        let GaussianArrays { sh_dc, opacity_logits, .. } = &scene.gaussians;
        let opacities = opacity_logits.iter().map(|logit| 10.0 * logit);
        sh_dc.as_flattened().iter().copied().chain(opacities).collect()
    }

    #[test]
    fn sensitive_attributes_get_finer_steps() {
        let given = given();
        let steps = search(&scene(), &given, 0.1, 1e-3, &images).unwrap();
        assert!(steps.of("opacity_logits") < steps.of("sh_dc").map(|step| 0.5 * step), "{steps:?}");
        // The images do not depend on scales and rotations.
        let grown = |name| given.of(name).map(|step| step * LARGEST_GROWTH as f32);
        assert_eq!(steps.of("log_scales"), grown("log_scales"));
        assert_eq!(steps.of("quats"), grown("quats"));
    }

    #[test]
    fn a_smaller_tolerance_gives_finer_steps() {
        let given = given();
        let at = |tolerance| search(&scene(), &given, tolerance, 1e-3, &images).unwrap();
        assert!(at(0.02).of("opacity_logits") < at(0.2).of("opacity_logits"));
    }
}
