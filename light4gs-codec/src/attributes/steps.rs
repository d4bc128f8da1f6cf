//! How finely the attributes are quantized.

use std::collections::BTreeMap;

use super::SECTION;
use crate::{CodecError, adaptive::LARGEST_STEP, scene::BUILT_IN, steps};

/// How finely each attribute of a Gaussian is quantized: steps by the attributes' names.
///
/// Every step is the distance between two neighboring levels, so an attribute is off by half of it at most. Measured
/// at 200 pixels, the defaults cost 0.1 dB of a scene that reaches 33 dB, and less of one that reaches 26; positions and
/// scales are what an image feels most. Halving a step costs one bit for each of its numbers.
///
/// | attribute | default | in units of |
/// |---|---:|---|
/// | `means` | 0.05 | the size of the typical Gaussian: the median over the Gaussians of the geometric mean of the three scales. What a shift does to the image depends on how large the shifted Gaussian is, and Gaussians are as small as the pixels that they were trained on; so this one number suits scenes of any extent and resolution. The grid never has more than 2^20 cells along an axis: beyond, the step grows |
/// | `log_scales` | 0.1 | natural logarithms: a size is off by 5 % at most |
/// | `quats` | 0.02 | the quaternion's components, which are not normalized |
/// | `opacity_logits` | 0.4 | opacity before the sigmoid: 5 % of opacity at most, where it is a half |
/// | `sh_dc` | 0.04 | degree-0 coefficients: 2.9 of 255 levels of a color, so a color is off by half of that at most |
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
    /// These steps with another one for an attribute.
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

    /// Refuses steps below [`LEAST_STEP`](crate::checks::LEAST_STEP) (that of the positions only where it is not positive) or above 1e30.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), CodecError> {
        self.iter().try_for_each(|(attribute, step)| steps::attribute_step(attribute, step))
    }

    /// The nearest steps that [`AttributeSteps::check`] takes; NaN becomes the smallest.
    pub fn clamped(mut self) -> Self {
        for (attribute, step) in &mut self.steps {
            *step = step.max(steps::least_step(attribute)).min(LARGEST_STEP);
        }
        self
    }
}

/// Refuses a step of a stream under which a decoded number could be infinite.
pub(super) fn check_step(attribute: &str, step: f32) -> Result<(), CodecError> {
    steps::check_step(SECTION, format!("step of {attribute}"), step, f32::MIN_POSITIVE)
}
