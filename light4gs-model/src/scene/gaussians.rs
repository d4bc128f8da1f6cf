//! The static set of Gaussians.

use std::ops::Range;
use std::sync::Arc;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_data::PointCloud;

use super::attributes::{Attribute, BUILT_IN, LOG_SCALES, OPACITY_LOGITS};
use super::further::{FurtherParameters, FurtherTensor};
use crate::parameters::{ParameterMapper, ParameterVisitor, map_parameters, visit_parameters};

/// Configuration of [`Gaussians`].
#[derive(Clone, Debug)]
pub struct GaussiansConfig {
    /// Degree of the spherical harmonics, 0 to 3.
    pub sh_degree: usize,
    /// Opacity at the start, in (0, 1).
    pub opacity: f32,
    /// Attributes besides [`BUILT_IN`]; each name once, and no built-in name.
    pub further: Vec<Attribute>,
}

impl Default for GaussiansConfig {
    fn default() -> Self {
        Self::new()
    }
}

impl GaussiansConfig {
    /// Harmonics of degree 3, opacity 0.1, no further attributes.
    pub fn new() -> Self {
        Self { sh_degree: 3, opacity: 0.1, further: Vec::new() }
    }

    /// With harmonics up to a degree, 0 to 3.
    pub fn with_sh_degree(self, sh_degree: usize) -> Self {
        Self { sh_degree, ..self }
    }

    /// With an opacity at the start, in (0, 1).
    pub fn with_opacity(self, opacity: f32) -> Self {
        Self { opacity, ..self }
    }

    /// With one further attribute.
    pub fn with_attribute(mut self, attribute: Attribute) -> Self {
        self.further.push(attribute);
        self
    }

    /// One Gaussian for each point: isotropic, as large as the root of the mean squared distance to the three nearest
    /// neighbors, unrotated, in the point's color.
    ///
    /// # Panics
    /// If the initial values of a further attribute do not have the length that follows from its width.
    pub fn init(&self, cloud: &PointCloud, device: &Device) -> Gaussians {
        let count = cloud.positions.len();
        let matrix = |attribute: &Attribute| {
            let shape = [count, attribute.width.of(self.sh_degree)];
            Tensor::<2>::from_data(TensorData::new(attribute.start(cloud, self), shape), device)
        };
        let cube = |attribute: &Attribute| {
            let shape = [count, attribute.width.of(self.sh_degree) / 3, 3];
            Tensor::<3>::from_data(TensorData::new(attribute.start(cloud, self), shape), device)
        };
        let [means, log_scales, quats, opacity_logits, sh_dc, sh_rest] = BUILT_IN.each_ref();
        let further = self.further.iter();
        Gaussians::from_tensors(GaussianTensors {
            means: matrix(means),
            log_scales: matrix(log_scales),
            quats: matrix(quats),
            opacity_logits: matrix(opacity_logits),
            sh_dc: cube(sh_dc),
            sh_rest: cube(sh_rest),
            further: further
                .map(|attribute| FurtherTensor { values: matrix(attribute), attribute: Arc::new(attribute.clone()) })
                .collect(),
        })
    }
}

/// Raw attributes of N Gaussians as tensors: canonical or at a time.
#[derive(Clone, Debug)]
pub struct GaussianTensors {
    /// `[N, 3]`, world units.
    pub means: Tensor<2>,
    /// `[N, 3]`, natural logarithms of standard deviations in world units.
    pub log_scales: Tensor<2>,
    /// `[N, 4]` as (w, x, y, z), of any length but zero.
    pub quats: Tensor<2>,
    /// `[N, 1]`.
    pub opacity_logits: Tensor<2>,
    /// `[N, 1, 3]`.
    pub sh_dc: Tensor<3>,
    /// `[N, (degree + 1)^2 - 1, 3]`.
    pub sh_rest: Tensor<3>,
    /// The further attributes, `[N, width]` each.
    pub further: Vec<FurtherTensor>,
}

/// A function that replaces every attribute, whatever its rank; a closure could not be generic.
pub trait AttributeMapper {
    /// Called once for each attribute; the result replaces `values`.
    fn map<const D: usize>(&mut self, attribute: &Attribute, values: Tensor<D>) -> Tensor<D>;
}

impl GaussianTensors {
    /// Every attribute replaced by the mapper's result, in the order of the fields.
    pub fn map(self, mapper: &mut impl AttributeMapper) -> Self {
        let [means, log_scales, quats, opacity_logits, sh_dc, sh_rest] = BUILT_IN.each_ref();
        Self {
            means: mapper.map(means, self.means),
            log_scales: mapper.map(log_scales, self.log_scales),
            quats: mapper.map(quats, self.quats),
            opacity_logits: mapper.map(opacity_logits, self.opacity_logits),
            sh_dc: mapper.map(sh_dc, self.sh_dc),
            sh_rest: mapper.map(sh_rest, self.sh_rest),
            further: self
                .further
                .into_iter()
                .map(|FurtherTensor { attribute, values }| {
                    let values = mapper.map(&attribute, values);
                    FurtherTensor { attribute, values }
                })
                .collect(),
        }
    }

    /// The Gaussians of some rows, with all attributes.
    ///
    /// # Panics
    /// If the range reaches beyond the last row.
    pub fn rows(self, rows: Range<usize>) -> Self {
        struct Rows(Range<usize>);
        impl AttributeMapper for Rows {
            fn map<const D: usize>(&mut self, _: &Attribute, values: Tensor<D>) -> Tensor<D> {
                values.narrow(0, self.0.start, self.0.len())
            }
        }
        self.map(&mut Rows(rows))
    }

    /// A further attribute by name, `[N, width]`.
    pub fn further(&self, name: &str) -> Option<&Tensor<2>> {
        self.further.iter().find(|tensor| tensor.attribute.name == name).map(|tensor| &tensor.values)
    }

    /// Sets the attributes that are [constant](Attribute::constant) to their canonical values.
    pub(super) fn with_constants_of(mut self, rest: &[FurtherTensor]) -> Self {
        for constant in rest.iter().filter(|tensor| tensor.attribute.constant) {
            let same = |tensor: &&mut FurtherTensor| tensor.attribute.name == constant.attribute.name;
            if let Some(moved) = self.further.iter_mut().find(same) {
                moved.values = constant.values.clone();
            }
        }
        self
    }

    /// The same values off the tape; tensors that were never on one stay as they are.
    pub fn inner(self) -> Self {
        struct Inner;
        impl AttributeMapper for Inner {
            fn map<const D: usize>(&mut self, _: &Attribute, values: Tensor<D>) -> Tensor<D> {
                if values.device().is_autodiff() { values.inner() } else { values }
            }
        }
        self.map(&mut Inner)
    }
}

/// Attributes of N Gaussians as they are drawn: standard deviations and opacities in place of the trained logarithms
/// and logits.
#[derive(Clone, Debug)]
pub struct ActivatedGaussians {
    /// `[N, 3]`, world units.
    pub means: Tensor<2>,
    /// `[N, 4]` as (w, x, y, z), of any length but zero.
    pub quats: Tensor<2>,
    /// `[N, 3]`, standard deviations in world units.
    pub scales: Tensor<2>,
    /// `[N, 1]` in [0, 1].
    pub opacities: Tensor<2>,
    /// `[N, 1, 3]`.
    pub sh_dc: Tensor<3>,
    /// `[N, (degree + 1)^2 - 1, 3]`.
    pub sh_rest: Tensor<3>,
}

impl GaussianTensors {
    /// Applies the exponential and the sigmoid. Further attributes are not drawn, so they are left out.
    pub fn activated(self) -> ActivatedGaussians {
        ActivatedGaussians {
            means: self.means,
            quats: self.quats,
            scales: LOG_SCALES.activation.apply(self.log_scales),
            opacities: OPACITY_LOGITS.activation.apply(self.opacity_logits),
            sh_dc: self.sh_dc,
            sh_rest: self.sh_rest,
        }
    }
}

/// Trained attributes of N Gaussians.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::PointCloud;
/// use light4gs_model::GaussiansConfig;
///
/// let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
/// let gaussians = GaussiansConfig::new().init(&cloud, &Device::flex());
/// assert_eq!(gaussians.len(), 2);
/// assert_eq!(gaussians.sh_rest.dims(), [2, 15, 3]);
/// ```
#[derive(Module, Debug)]
pub struct Gaussians {
    /// `[N, 3]`, world units.
    pub means: Param<Tensor<2>>,
    /// `[N, 3]`, natural logarithms of standard deviations in world units.
    pub log_scales: Param<Tensor<2>>,
    /// `[N, 4]` as (w, x, y, z).
    pub quats: Param<Tensor<2>>,
    /// `[N, 1]`.
    pub opacity_logits: Param<Tensor<2>>,
    /// `[N, 1, 3]`.
    pub sh_dc: Param<Tensor<3>>,
    /// `[N, (degree + 1)^2 - 1, 3]`.
    pub sh_rest: Param<Tensor<3>>,
    /// The further attributes, `[N, width]` each.
    pub further: FurtherParameters,
}

impl Gaussians {
    /// Parameters with the values of tensors.
    pub fn from_tensors(tensors: GaussianTensors) -> Self {
        Self {
            means: Param::from_tensor(tensors.means),
            log_scales: Param::from_tensor(tensors.log_scales),
            quats: Param::from_tensor(tensors.quats),
            opacity_logits: Param::from_tensor(tensors.opacity_logits),
            sh_dc: Param::from_tensor(tensors.sh_dc),
            sh_rest: Param::from_tensor(tensors.sh_rest),
            further: FurtherParameters::from_tensors(tensors.further),
        }
    }

    /// The canonical attributes, on the tape where autodiff is on.
    pub fn tensors(&self) -> GaussianTensors {
        GaussianTensors {
            means: self.means.val(),
            log_scales: self.log_scales.val(),
            quats: self.quats.val(),
            opacity_logits: self.opacity_logits.val(),
            sh_dc: self.sh_dc.val(),
            sh_rest: self.sh_rest.val(),
            further: self.further.tensors(),
        }
    }

    /// Replaces the parameters' values. The number of rows may change; the parameters keep their identities in an
    /// optimizer.
    pub fn set_tensors(&mut self, tensors: GaussianTensors) {
        #[derive(Default)]
        struct Identities(Vec<ParamId>);
        impl ParameterVisitor for Identities {
            fn visit<const D: usize>(&mut self, _: &str, parameter: &Param<Tensor<D>>) {
                self.0.push(parameter.id);
            }
        }
        struct Identify(std::vec::IntoIter<ParamId>);
        impl ParameterMapper for Identify {
            fn map<const D: usize>(&mut self, _: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
                let id = self.0.next().unwrap_or(parameter.id);
                Param::initialized(id, parameter.into_value())
            }
        }
        let mut identities = Identities::default();
        visit_parameters(self, &mut identities);
        *self = map_parameters(Self::from_tensors(tensors), &mut Identify(identities.0.into_iter()));
    }

    /// The attributes of every Gaussian: [`BUILT_IN`], then the further ones.
    pub fn attributes(&self) -> impl Iterator<Item = &Attribute> + Clone {
        BUILT_IN.iter().chain(self.further.attributes())
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.dims()[0]
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Degree of the spherical harmonics.
    pub fn sh_degree(&self) -> usize {
        (self.sh_rest.dims()[1] + 1).isqrt() - 1
    }
}
