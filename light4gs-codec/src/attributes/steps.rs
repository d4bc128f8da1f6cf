//! How finely the attributes are quantized.

use std::collections::BTreeMap;

use super::SECTION;
use crate::{CodecError, adaptive::LARGEST_STEP, scene::BUILT_IN, steps};

/// How finely each attribute of a Gaussian is quantized: steps by the attributes' names.
///
/// Every step is the distance between two neighboring levels, so the error of an attribute is at most half of it.
/// Measured at 200 pixels, the defaults cost a scene that reaches 33 dB 0.1 dB, and one that reaches 26 dB less. Errors
/// of positions and scales change an image most. Halving a step takes one bit more for each number.
///
/// | attribute | default | in units of |
/// |---|---:|---|
/// | `means` | 0.05 | the size of the typical Gaussian: the median over the Gaussians of the geometric mean of the three scales. What a shift does to the image depends on how large the shifted Gaussian is, and Gaussians are as small as the pixels that they were trained on; so this one number suits scenes of any extent and resolution. The grid never has more than 2^20 cells along an axis; if the step is too small for that, a larger one is taken |
/// | `log_scales` | 0.1 | natural logarithms: the error of a size is at most 5 % |
/// | `quats` | 0.02 | the quaternion's components, which are not normalized |
/// | `opacity_logits` | 0.4 | opacity before the sigmoid: the error of an opacity of one half is at most 0.05 |
/// | `sh_dc` | 0.04 | degree-0 coefficients: 2.9 of the 255 levels of a color, so the error is at most half of that |
///
/// A further attribute that has no step here is stored as float32.
///
/// ```
/// use light4gs_codec::attributes::AttributeSteps;
///
/// let steps = AttributeSteps::default().with("quats", 0.01).with("lifetime", 0.005);
/// assert_eq!((steps.of("quats"), steps.of("sh_dc"), steps.of("age")), (Some(0.01), Some(0.04), None));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AttributeSteps {
    /// Has all built-in attributes but `sh_rest`, whose step belongs to its entropy model.
    steps: BTreeMap<String, f32>,
}

impl Default for AttributeSteps {
    fn default() -> Self {
        Self { steps: BUILT_IN.map(|row| (row.name.to_owned(), row.step)).into() }
    }
}

impl AttributeSteps {
    /// These steps, with the step of one attribute replaced.
    pub fn with(mut self, attribute: &str, step: f32) -> Self {
        self.steps.insert(attribute.to_owned(), step);
        self
    }

    /// The step of an attribute; none for a further one that is stored as float32.
    pub fn of(&self, attribute: &str) -> Option<f32> {
        self.steps.get(attribute).copied()
    }

    /// Names and steps, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f32)> {
        self.steps.iter().map(|(name, step)| (name.as_str(), *step))
    }

    /// Refuses steps below [`LEAST_STEP`](crate::checks::LEAST_STEP) or above 1e30. The step of the positions only has
    /// to be positive.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), CodecError> {
        self.iter().try_for_each(|(attribute, step)| steps::attribute_step(attribute, step))
    }

    /// The nearest steps that [`AttributeSteps::check`] accepts; NaN becomes the smallest.
    pub fn clamped(mut self) -> Self {
        for (attribute, step) in &mut self.steps {
            *step = step.max(steps::least_step(attribute)).min(LARGEST_STEP);
        }
        self
    }
}

/// Refuses a step from a stream with which a decoded number could be infinite.
pub(super) fn check_step(attribute: &str, step: f32) -> Result<(), CodecError> {
    steps::check_step(SECTION, format!("step of {attribute}"), step, f32::MIN_POSITIVE)
}
