//! The attributes of a Gaussian: one table, from which everything else follows.
//!
//! [`BUILT_IN`] are the attributes of every scene, which the splatter needs. A scene may have further ones: give
//! [`GaussiansConfig`] an [`Attribute`], and it is trained at its rate, copied where a Gaussian is cloned or split,
//! kept in checkpoints, and coded with its step. A [`DeformationField`](crate::DeformationField), which gets all
//! attributes of a Gaussian, decides what it does to the image.
//!
//! ```
//! use burn::tensor::Device;
//! use light4gs_data::PointCloud;
//! use light4gs_model::{Attribute, GaussiansConfig};
//!
//! let lifetime = Attribute::new("lifetime", 2).with_start(vec![0.5, 0.0]).with_learning_rate(1e-2).with_step(0.01);
//! let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
//! let gaussians = GaussiansConfig::new().with_attribute(lifetime).init(&cloud, &Device::flex());
//! assert_eq!(gaussians.tensors().further("lifetime").unwrap().dims(), [2, 2]);
//! ```

use std::borrow::Cow;

use burn::tensor::Tensor;
use light4gs_codec::legal_attribute_name;
use light4gs_data::PointCloud;

use super::gaussians::GaussiansConfig;
use crate::ops::activation::{bounded_exponential, sigmoid};

/// One attribute of every Gaussian.
#[derive(Clone, Debug)]
pub struct Attribute {
    /// The name of its field in [`Gaussians`](crate::Gaussians), or of the further attribute. Checkpoints and files use
    /// it.
    pub name: Cow<'static, str>,
    /// Numbers for each Gaussian.
    pub width: Width,
    /// Values at the beginning of a training.
    pub start: Start,
    /// The function from the trained numbers to those that are used.
    pub activation: Activation,
    /// Its learning rate, unless the training's configuration names it.
    pub learning_rate: AttributeRate,
    /// How a file stores it.
    pub coding: Coding,
    /// Whether it always keeps its canonical value: [`DynamicScene::at`](crate::DynamicScene::at) then ignores the
    /// field's values.
    pub constant: bool,
    /// Whether the scene looks right without it, so that a program that does not know it may show the scene.
    pub optional: bool,
}

/// The number of values of an attribute for each Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// A fixed number.
    Fixed(usize),
    /// A number that depends on the scene's degree: three for each spherical harmonic beyond degree 0.
    HigherHarmonics,
}

/// The initial values of an attribute.
#[derive(Clone, Debug)]
pub enum Start {
    /// These numbers for every Gaussian.
    Row(Cow<'static, [f32]>),
    /// Zeros.
    Zeros,
    /// Numbers `[N, width]`, row-major, computed from the initial cloud of N points.
    Cloud(fn(&PointCloud, &GaussiansConfig) -> Vec<f32>),
}

/// The function from trained numbers to those that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Nothing.
    Identity,
    /// The exponential, for positive values.
    Exponential,
    /// The sigmoid, for values in [0, 1].
    Sigmoid,
}

/// The learning rate of an attribute over a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttributeRate {
    /// At the first step.
    pub initial: f64,
    /// At the end of the schedule; none where it stays the same.
    pub last: Option<f64>,
    /// Whether it is learned in world units, so that its rate is multiplied by the scene's extent.
    pub by_extent: bool,
}

/// How a file stores an attribute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coding {
    /// In multiples of this step, where the file is quantized, unless the training's configuration names the attribute.
    /// The step of the positions is a share of the typical Gaussian's size.
    Quantized(f64),
    /// As float32, whatever else is quantized.
    Float32,
    /// In a section of its own, with an entropy model of its own: the spherical harmonics beyond degree 0.
    Harmonics,
}

impl AttributeRate {
    /// The same rate at all steps, whatever the scene's extent.
    pub const fn constant(rate: f64) -> Self {
        Self { initial: rate, last: None, by_extent: false }
    }
}

impl Activation {
    /// Applies it.
    pub fn apply<const D: usize>(self, values: Tensor<D>) -> Tensor<D> {
        match self {
            Self::Identity => values,
            Self::Exponential => bounded_exponential(values),
            Self::Sigmoid => sigmoid(values),
        }
    }
}

impl Width {
    /// The number, for harmonics up to a degree.
    pub fn of(self, sh_degree: usize) -> usize {
        match self {
            Self::Fixed(width) => width,
            Self::HigherHarmonics => 3 * ((sh_degree + 1).pow(2) - 1),
        }
    }
}

/// Positions, world units.
pub static MEANS: &Attribute = &BUILT_IN[0];
/// Natural logarithms of standard deviations, world units.
pub static LOG_SCALES: &Attribute = &BUILT_IN[1];
/// Rotations (w, x, y, z).
pub static QUATS: &Attribute = &BUILT_IN[2];
/// Opacities before the sigmoid.
pub static OPACITY_LOGITS: &Attribute = &BUILT_IN[3];

/// Spherical harmonics beyond degree 0.
pub static SH_REST: &Attribute = &BUILT_IN[5];

/// The attributes of every Gaussian of every scene, in the order of [`Gaussians`](crate::Gaussians).
pub static BUILT_IN: [Attribute; 6] = [
    built_in(
        ("means", Width::Fixed(3)),
        Start::Cloud(|cloud, _| cloud.positions.concat()),
        Activation::Identity,
        AttributeRate { initial: 1.6e-4, last: Some(1.6e-6), by_extent: true },
        Coding::Quantized(0.05),
    ),
    built_in(
        ("log_scales", Width::Fixed(3)),
        // As large as the root of the mean squared distance to the three nearest neighbors.
        Start::Cloud(|cloud, _| {
            cloud.mean_squared_distances().iter().flat_map(|squared| [0.5 * squared.ln(); 3]).collect()
        }),
        Activation::Exponential,
        AttributeRate::constant(0.005),
        Coding::Quantized(0.1),
    ),
    built_in(
        ("quats", Width::Fixed(4)),
        Start::Row(Cow::Borrowed(&[1.0, 0.0, 0.0, 0.0])),
        Activation::Identity,
        AttributeRate::constant(0.001),
        Coding::Quantized(0.02),
    ),
    built_in(
        ("opacity_logits", Width::Fixed(1)),
        Start::Cloud(|cloud, config| {
            let logit = (config.opacity / (1.0 - config.opacity)).ln();
            vec![logit; cloud.positions.len()]
        }),
        Activation::Sigmoid,
        AttributeRate::constant(0.05),
        Coding::Quantized(0.4),
    ),
    built_in(
        ("sh_dc", Width::Fixed(3)),
        Start::Cloud(|cloud, _| cloud.sh_dc().concat()),
        Activation::Identity,
        AttributeRate::constant(2.5e-3),
        Coding::Quantized(0.04),
    ),
    built_in(
        ("sh_rest", Width::HigherHarmonics),
        Start::Zeros,
        Activation::Identity,
        // A twentieth of that of `sh_dc`.
        AttributeRate::constant(1.25e-4),
        Coding::Harmonics,
    ),
];

/// A row of the table.
const fn built_in(
    (name, width): (&'static str, Width),
    start: Start,
    activation: Activation,
    learning_rate: AttributeRate,
    coding: Coding,
) -> Attribute {
    let name = Cow::Borrowed(name);
    Attribute { name, width, start, activation, learning_rate, coding, constant: false, optional: false }
}

/// Refuses further attributes that no scene can have.
///
/// # Errors
/// As text: a name that no file can hold, a name that occurs twice, a width of 0.
pub fn check_further(attributes: &[Attribute]) -> Result<(), String> {
    for (index, attribute) in attributes.iter().enumerate() {
        let name = &attribute.name;
        if !legal_attribute_name(name) {
            return Err(format!("`{name}`: a name is 1 to 64 of a-z, 0-9, `-`, `_`, and none that every Gaussian has"));
        }
        if attributes[..index].iter().any(|other| other.name == *name) {
            return Err(format!("`{name}` stands twice; each attribute has a name of its own"));
        }
        if attribute.width.of(0) == 0 {
            return Err(format!("`{name}` has no numbers; its width must be 1 or more"));
        }
    }
    Ok(())
}

/// Prefix of the paths of attributes in a scene, and what follows it for further attributes.
const GAUSSIANS: &str = "gaussians.";
const FURTHER: &str = "further.";

/// The name of the attribute whose parameter has a path in a scene: the inverse of [`Attribute::path`].
pub fn attribute_of_path(path: &str) -> Option<&str> {
    let name = path.strip_prefix(GAUSSIANS)?;
    Some(name.strip_prefix(FURTHER).unwrap_or(name))
}

/// Learning rate of a further attribute that does not set one: that of colors.
const DEFAULT_LEARNING_RATE: f64 = 2.5e-3;

impl Attribute {
    /// A further attribute with `width` numbers for each Gaussian. It starts at zeros and is stored as float32, and a
    /// program that does not know it refuses to show the scene.
    pub fn new(name: impl Into<String>, width: usize) -> Self {
        Self {
            name: Cow::Owned(name.into()),
            width: Width::Fixed(width),
            start: Start::Zeros,
            activation: Activation::Identity,
            learning_rate: AttributeRate::constant(DEFAULT_LEARNING_RATE),
            coding: Coding::Float32,
            constant: false,
            optional: false,
        }
    }

    /// With these initial numbers for every Gaussian.
    pub fn with_start(self, row: Vec<f32>) -> Self {
        Self { start: Start::Row(Cow::Owned(row)), ..self }
    }

    /// With initial numbers that are computed from the initial cloud: `[N, width]`, row-major.
    pub fn with_start_of_cloud(self, start: fn(&PointCloud, &GaussiansConfig) -> Vec<f32>) -> Self {
        Self { start: Start::Cloud(start), ..self }
    }

    /// With this learning rate at all steps.
    pub fn with_learning_rate(self, rate: f64) -> Self {
        Self { learning_rate: AttributeRate::constant(rate), ..self }
    }

    /// Stored in multiples of a step where the file is quantized.
    pub fn with_step(self, step: f64) -> Self {
        Self { coding: Coding::Quantized(step), ..self }
    }

    /// With an activation, which [`GaussianTensors::activated`](crate::GaussianTensors::activated) applies.
    pub fn with_activation(self, activation: Activation) -> Self {
        Self { activation, ..self }
    }

    /// With its canonical value at all times.
    pub fn constant(self) -> Self {
        Self { constant: true, ..self }
    }

    /// Marked as not needed for the scene to look right.
    pub fn optional(self) -> Self {
        Self { optional: true, ..self }
    }

    /// The path of its parameter in a scene, as in `gaussians.means` or `gaussians.further.lifetime`.
    pub fn path(&self) -> String {
        let further = if BUILT_IN.iter().any(|row| row.name == self.name) { "" } else { FURTHER };
        format!("{GAUSSIANS}{further}{}", self.name)
    }

    /// Initial values of N Gaussians, `[N, width]` row-major.
    ///
    /// # Panics
    /// If the attribute's own initial values have another length.
    pub(super) fn start(&self, cloud: &PointCloud, config: &GaussiansConfig) -> Vec<f32> {
        let (count, width) = (cloud.positions.len(), self.width.of(config.sh_degree));
        let values = match &self.start {
            Start::Row(row) => row.repeat(count),
            Start::Zeros => vec![0.0; count * width],
            Start::Cloud(start) => start(cloud, config),
        };
        assert_eq!(values.len(), count * width, "the start of `{}` must be {width} numbers per Gaussian", self.name);
        values
    }
}

#[cfg(test)]
mod tests {
    use light4gs_codec::attributes::AttributeSteps;

    use super::*;

    /// The codec has a small form of the table, since it cannot depend on this crate. The two must agree.
    #[test]
    fn the_codec_has_the_same_table() {
        let steps = AttributeSteps::default();
        for attribute in &BUILT_IN {
            let step = match attribute.coding {
                Coding::Quantized(step) => Some(step as f32),
                Coding::Float32 | Coding::Harmonics => None,
            };
            assert_eq!(steps.of(&attribute.name), step, "{}", attribute.name);
        }
        assert_eq!(steps.iter().count(), BUILT_IN.len() - 1);
        let arrays = light4gs_codec::GaussianArrays { sh_degree: 2, ..Default::default() };
        let table: Vec<_> = BUILT_IN.iter().map(|row| (&*row.name, row.width.of(2))).collect();
        assert_eq!(arrays.attributes().map(|row| (row.name, row.width)).collect::<Vec<_>>(), table);
    }
}
