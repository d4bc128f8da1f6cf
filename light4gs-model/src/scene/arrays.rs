//! Between Burn modules and the codec's plain arrays.

use std::sync::Arc;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::{
    FeaturePlaneArrays, FurtherAttribute, GaussianArrays, MotionArrays, SceneCoordinateArrays, SceneData, SceneMeta,
};

use super::attributes::Attribute;
use super::coordinates::{Pca, SceneCoordinates};
use super::dynamic_scene::DynamicScene;
use super::field::DeformationField;
use super::further::FurtherTensor;
use super::gaussians::{GaussianTensors, Gaussians};
use crate::planes::{FeaturePlanes, PlaneTensors};

/// Plain arrays from which no model can be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// The file has a kind of motion that this model does not know.
    #[error("motion: the file's kind is `{found}`, this model is a `{expected}`")]
    MotionKind {
        /// The kind in the file.
        found: String,
        /// The kinds of the model.
        expected: String,
    },
    /// A field whose coding has not been implemented.
    #[error(
        "motion: a field of the kind `{kind}` cannot be {action} a file yet: implement `DeformationField::{method}` for it"
    )]
    NoStreamForm {
        /// The field's kind.
        kind: &'static str,
        /// "written to" or "read from".
        action: &'static str,
        /// What must be implemented.
        method: &'static str,
    },
    /// The motion does not have the structure of its kind.
    #[error("motion: {0}")]
    Motion(String),
    /// The Gaussians have an attribute without which the scene looks wrong, and it is not known what the attribute
    /// does.
    #[error("{0}")]
    UnknownAttribute(String),
    /// The planes contradict themselves, or are not those that the field needs.
    #[error("feature planes: {0}")]
    Planes(String),
}

impl ModelError {
    /// The error for a file that is of none of these kinds.
    pub(crate) fn kind(found: &str, known: &[&str]) -> Self {
        // In a file, the kind of a scene without motion is empty.
        let named = |kind: &&str| if kind.is_empty() { "still".to_owned() } else { (*kind).to_owned() };
        let expected = known.iter().map(named).collect::<Vec<_>>().join("` or `");
        Self::MotionKind { found: named(&found), expected }
    }
}

/// Row-major values of a tensor.
fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

fn rows<const N: usize>(tensor: Tensor<2>) -> Vec<[f32; N]> {
    values(tensor).as_chunks().0.to_vec()
}

fn matrix<const N: usize>(rows: &[[f32; N]], device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(rows.concat(), [rows.len(), N]), device)
}

impl Gaussians {
    /// Copies to plain arrays.
    pub fn to_arrays(&self) -> GaussianArrays {
        self.tensors().to_arrays()
    }

    /// From plain arrays whose lengths fit together (the codec checks that on reading).
    pub fn from_arrays(arrays: &GaussianArrays, device: &Device) -> Self {
        let count = arrays.len();
        let rest = (usize::from(arrays.sh_degree) + 1).pow(2) - 1;
        let cube = |values: Vec<f32>, middle| Tensor::from_data(TensorData::new(values, [count, middle, 3]), device);
        let further = |given: &FurtherAttribute| {
            let FurtherAttribute { name, width, values, optional } = given;
            let shape = [count, *width as usize];
            let values = Tensor::from_data(TensorData::new(values.clone(), shape), device);
            let attribute = Attribute { optional: *optional, ..Attribute::new(name, *width as usize) };
            FurtherTensor { attribute: Arc::new(attribute), values }
        };
        Self::from_tensors(GaussianTensors {
            means: matrix(&arrays.means, device),
            log_scales: matrix(&arrays.log_scales, device),
            quats: matrix(&arrays.quats, device),
            opacity_logits: Tensor::from_data(TensorData::new(arrays.opacity_logits.clone(), [count, 1]), device),
            sh_dc: cube(arrays.sh_dc.concat(), 1),
            sh_rest: cube(arrays.sh_rest.clone(), rest),
            further: arrays.further.iter().map(further).collect(),
        })
    }
}

impl GaussianTensors {
    /// Copies to plain arrays.
    pub fn to_arrays(&self) -> GaussianArrays {
        let further = |FurtherTensor { attribute, values: tensor }: &FurtherTensor| FurtherAttribute {
            name: attribute.name.to_string(),
            width: tensor.dims()[1] as u32,
            values: values(tensor.clone()),
            optional: attribute.optional,
        };
        GaussianArrays {
            means: rows(self.means.clone()),
            log_scales: rows(self.log_scales.clone()),
            quats: rows(self.quats.clone()),
            opacity_logits: values(self.opacity_logits.clone()),
            sh_dc: values(self.sh_dc.clone()).as_chunks().0.to_vec(),
            sh_degree: ((self.sh_rest.dims()[1] + 1).isqrt() - 1) as u8,
            sh_rest: values(self.sh_rest.clone()),
            further: self.further.iter().map(further).collect(),
        }
    }
}

impl SceneCoordinates {
    fn to_arrays(&self) -> SceneCoordinateArrays {
        let Pca { mean, axes, std } = self.pca();
        SceneCoordinateArrays { mean, axes, std, mapping: self.mapping() }
    }
}

impl FeaturePlanes {
    /// Copies to plain arrays.
    pub fn to_arrays(&self) -> FeaturePlaneArrays {
        let mut arrays = FeaturePlaneArrays::without_values(self.channels() as u32, self.layout());
        for (plane, parameter) in arrays.planes.iter_mut().zip(&self.planes) {
            plane.values = values(parameter.val());
        }
        arrays
    }

    /// From plain arrays.
    ///
    /// # Errors
    /// [`ModelError::Planes`] if there are none, if they are no layout, or if a plane has another number of values than
    /// follows from its size.
    pub fn from_arrays(arrays: &FeaturePlaneArrays, device: &Device) -> Result<Self, ModelError> {
        let wrong = |problem: String| Err(ModelError::Planes(problem));
        if arrays.planes.is_empty() {
            return wrong("there are none".into());
        }
        let layout = arrays.layout().map_err(|error| ModelError::Planes(error.to_string()))?;
        let mut tensors = Vec::with_capacity(arrays.planes.len());
        for (plane, shape) in arrays.planes.iter().zip(layout.planes()) {
            let [height, width] = shape.size;
            let dims = [arrays.channels as usize, height, width];
            if plane.values.len() != dims.iter().product::<usize>() {
                return wrong(format!("plane {} has {} values for {dims:?}", shape.name(), plane.values.len()));
            }
            tensors.push(Tensor::from_data(TensorData::new(plane.values.clone(), dims), device));
        }
        Ok(Self::from_tensors(PlaneTensors::new(layout, tensors)))
    }
}

impl<F: DeformationField> DynamicScene<F> {
    /// Copies the model to the contents of a `.l4gs` file.
    ///
    /// # Errors
    /// [`ModelError::NoStreamForm`] for a field whose coding has not been implemented.
    pub fn to_arrays(&self, meta: SceneMeta) -> Result<SceneData, ModelError> {
        Ok(SceneData { motion: self.field.to_arrays()?, ..self.to_arrays_at_rest(meta) })
    }

    /// [`DynamicScene::to_arrays`] without the motion: the planes are there, but nothing reads them.
    pub fn to_arrays_at_rest(&self, meta: SceneMeta) -> SceneData {
        SceneData {
            meta,
            gaussians: self.gaussians.to_arrays(),
            coordinates: self.coordinates.to_arrays(),
            feature_planes: self.planes().map(FeaturePlanes::to_arrays).unwrap_or_default(),
            motion: MotionArrays::default(),
        }
    }

    /// The model of a decoded file, on any device.
    ///
    /// # Errors
    /// - [`ModelError::UnknownAttribute`] for an attribute of unknown effect, without which the scene would look wrong
    /// - [`ModelError::MotionKind`] for another kind of field
    /// - [`ModelError::Planes`], [`ModelError::Motion`] for planes or layers that do not fit together, or are not those that
    ///   this kind of field needs
    /// - [`ModelError::NoStreamForm`] for a field whose decoding has not been implemented
    pub fn from_arrays(data: &SceneData, device: &Device) -> Result<Self, ModelError> {
        data.check_attributes_are_known().map_err(|error| ModelError::UnknownAttribute(error.to_string()))?;
        if !F::KINDS.contains(&data.motion.kind.as_str()) {
            return Err(ModelError::kind(&data.motion.kind, F::KINDS));
        }
        let planes = match data.feature_planes.planes.is_empty() {
            true => None,
            false => Some(FeaturePlanes::from_arrays(&data.feature_planes, device)?),
        };
        let SceneCoordinateArrays { mean, axes, std, mapping } = data.coordinates;
        Ok(Self {
            gaussians: Gaussians::from_arrays(&data.gaussians, device),
            coordinates: SceneCoordinates::new(&Pca { mean, axes, std }, device).with_mapping(mapping),
            field: F::from_arrays(&data.motion, planes, device)?,
            differentiate_points: true,
        }
        .no_grad())
    }
}
