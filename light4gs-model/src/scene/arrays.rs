//! Between Burn modules and the codec's plain arrays.

use burn::module::{Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::plane_layout::{PLANE_AXES, PLANES_PER_SCALE, TIME_AXIS, position_of, scale_of};
use light4gs_codec::{
    GaussianArrays, HeadFlags, HexPlaneArrays, LinearLayer, NetworkArrays, Plane, SceneData, SceneFrameArrays,
    SceneMeta,
};

use super::coordinates::{Pca, SceneCoordinates};
use super::deformation::{Deformation, DeformationHead};
use super::dynamic_scene::DynamicScene;
use super::field::DeformationField;
use super::gaussians::{GaussianTensors, Gaussians};
use super::hexplane::HexPlane;

/// Plain arrays that do not make a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModelError {
    /// A layer that the flags promise is not there.
    #[error("deformation network: layer `{0}` is missing")]
    MissingLayer(String),
    /// A layer has other inputs or outputs than its place asks for.
    #[error(
        "deformation network: layer `{name}` is {inputs} -> {outputs}, expected {expected_inputs} -> {expected_outputs}"
    )]
    LayerShape {
        /// Which layer.
        name: String,
        /// As found.
        inputs: usize,
        /// As found.
        outputs: usize,
        /// As needed.
        expected_inputs: usize,
        /// As needed.
        expected_outputs: usize,
    },
    /// The planes are not six a scale in the shapes that the resolution gives.
    #[error("hexplanes: {0}")]
    Planes(String),
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

    /// From plain arrays whose lengths belong together (the codec checks that on reading).
    pub fn from_arrays(arrays: &GaussianArrays, device: &Device) -> Self {
        let count = arrays.len();
        let rest = (usize::from(arrays.sh_degree) + 1).pow(2) - 1;
        let cube = |values: Vec<f32>, middle| Tensor::from_data(TensorData::new(values, [count, middle, 3]), device);
        Self::from_tensors(GaussianTensors {
            means: matrix(&arrays.means, device),
            log_scales: matrix(&arrays.log_scales, device),
            quats: matrix(&arrays.quats, device),
            opacity_logits: Tensor::from_data(TensorData::new(arrays.opacity_logits.clone(), [count, 1]), device),
            sh_dc: cube(arrays.sh_dc.concat(), 1),
            sh_rest: cube(arrays.sh_rest.clone(), rest),
        })
    }
}

impl GaussianTensors {
    /// Copies to plain arrays.
    pub fn to_arrays(&self) -> GaussianArrays {
        GaussianArrays {
            means: rows(self.means.clone()),
            log_scales: rows(self.log_scales.clone()),
            quats: rows(self.quats.clone()),
            opacity_logits: values(self.opacity_logits.clone()),
            sh_dc: values(self.sh_dc.clone()).as_chunks().0.to_vec(),
            sh_degree: ((self.sh_rest.dims()[1] + 1).isqrt() - 1) as u8,
            sh_rest: values(self.sh_rest.clone()),
        }
    }
}

impl SceneCoordinates {
    fn to_arrays(&self) -> SceneFrameArrays {
        let Pca { mean, axes, std } = self.pca();
        SceneFrameArrays { mean, axes, std }
    }
}

impl HexPlane {
    /// Copies to plain arrays. Resolutions are read off the planes.
    pub fn to_arrays(&self) -> HexPlaneArrays {
        let dims = |scale: usize, plane: usize| self.planes[PLANES_PER_SCALE * scale + plane].dims();
        let [channels, res_y, res_x] = dims(0, 0);
        let [_, res_t, res_z] = dims(0, 5);
        let planes = self.planes.iter().map(|plane| {
            let [_, height, width] = plane.dims();
            Plane { height: height as u32, width: width as u32, values: values(plane.val()) }
        });
        HexPlaneArrays {
            channels: channels as u32,
            resolution: [res_x, res_y, res_z, res_t].map(|r| r as u32),
            multipliers: (0..self.scales()).map(|scale| (dims(scale, 0)[2] / res_x) as u32).collect(),
            planes: planes.collect(),
        }
    }

    /// From plain arrays.
    pub fn from_arrays(arrays: &HexPlaneArrays, device: &Device) -> Result<Self, ModelError> {
        let channels = arrays.channels as usize;
        if arrays.planes.is_empty() || arrays.planes.len() != PLANES_PER_SCALE * arrays.multipliers.len() {
            let (planes, scales) = (arrays.planes.len(), arrays.multipliers.len());
            return Err(ModelError::Planes(format!("{planes} planes for {scales} scales, expected six a scale")));
        }
        let mut tensors = Vec::with_capacity(arrays.planes.len());
        for (i, plane) in arrays.planes.iter().enumerate() {
            let resolution = |axis: usize| {
                arrays.resolution[axis] * if axis == TIME_AXIS { 1 } else { arrays.multipliers[scale_of(i)] }
            };
            let [across, down] = PLANE_AXES[position_of(i)];
            let expected = (resolution(down), resolution(across));
            if (plane.height, plane.width) != expected {
                let found = (plane.height, plane.width);
                return Err(ModelError::Planes(format!("plane {i} is {found:?} cells, expected {expected:?}")));
            }
            let shape = [channels, plane.height as usize, plane.width as usize];
            if plane.values.len() != shape.iter().product::<usize>() {
                return Err(ModelError::Planes(format!("plane {i} has {} values for {shape:?}", plane.values.len())));
            }
            tensors.push(Tensor::from_data(TensorData::new(plane.values.clone(), shape), device));
        }
        Ok(Self::from_planes(tensors))
    }
}

fn layer_to_arrays(name: String, layer: &Linear) -> LinearLayer {
    let [inputs, outputs] = layer.weight.dims();
    LinearLayer {
        name,
        inputs: inputs as u32,
        outputs: outputs as u32,
        // Burn keeps [in, out], the stream [out, in].
        weight: values(layer.weight.val().transpose()),
        bias: layer.bias.as_ref().map(|bias| values(bias.val())).unwrap_or_else(|| vec![0.0; outputs]),
    }
}

impl Deformation {
    fn heads(&self) -> [(&'static str, &Option<DeformationHead>); 5] {
        [
            ("position", &self.position),
            ("scale", &self.scale),
            ("rotation", &self.rotation),
            ("opacity", &self.opacity),
            ("sh", &self.sh),
        ]
    }

    /// Copies to plain arrays; layers are named `trunk.0`, `position.hidden`, `position.output` and so on.
    pub fn to_arrays(&self) -> NetworkArrays {
        let trunk = self.trunk.iter().enumerate().map(|(i, layer)| layer_to_arrays(format!("trunk.{i}"), layer));
        let heads = self.heads().into_iter().filter_map(|(name, head)| head.as_ref().map(|head| (name, head)));
        let head_layers = heads.flat_map(|(name, head)| {
            [
                layer_to_arrays(format!("{name}.hidden"), &head.hidden),
                layer_to_arrays(format!("{name}.output"), &head.output),
            ]
        });
        NetworkArrays {
            width: self.trunk[0].weight.dims()[1] as u32,
            depth: self.trunk.len() as u32,
            heads: HeadFlags {
                position: self.position.is_some(),
                scale: self.scale.is_some(),
                rotation: self.rotation.is_some(),
                opacity: self.opacity.is_some(),
                sh: self.sh.is_some(),
            },
            layers: trunk.chain(head_layers).collect(),
        }
    }

    /// From plain arrays, for features of a known length.
    pub fn from_arrays(arrays: &NetworkArrays, feature_size: usize, device: &Device) -> Result<Self, ModelError> {
        let width = arrays.width as usize;
        let layer = |name: String, expected_inputs: usize, expected_outputs: usize| {
            let found = arrays.layers.iter().find(|layer| layer.name == name);
            let found = found.ok_or_else(|| ModelError::MissingLayer(name.clone()))?;
            let (inputs, outputs) = (found.inputs as usize, found.outputs as usize);
            if (inputs, outputs) != (expected_inputs, expected_outputs)
                || found.weight.len() != inputs * outputs
                || found.bias.len() != outputs
            {
                return Err(ModelError::LayerShape { name, inputs, outputs, expected_inputs, expected_outputs });
            }
            let weight = Tensor::<2>::from_data(TensorData::new(found.weight.clone(), [outputs, inputs]), device);
            let bias = Tensor::<1>::from_data(TensorData::new(found.bias.clone(), [outputs]), device);
            let mut linear = LinearConfig::new(inputs, outputs).init(device);
            // Copied, since a transposed view would be copied anew in every product.
            let transposed = Tensor::from_data(weight.transpose().into_data(), device);
            linear.weight = Param::from_tensor(transposed);
            linear.bias = Some(Param::from_tensor(bias));
            Ok(linear)
        };
        let head = |wanted: bool, name: &str, outputs: usize| -> Result<Option<DeformationHead>, ModelError> {
            wanted
                .then(|| {
                    Ok(DeformationHead {
                        hidden: layer(format!("{name}.hidden"), width, width)?,
                        output: layer(format!("{name}.output"), width, outputs)?,
                    })
                })
                .transpose()
        };
        let trunk = (0..arrays.depth.max(1))
            .map(|i| layer(format!("trunk.{i}"), if i == 0 { feature_size } else { width }, width))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            trunk,
            position: head(arrays.heads.position, "position", 3)?,
            scale: head(arrays.heads.scale, "scale", 3)?,
            rotation: head(arrays.heads.rotation, "rotation", 4)?,
            opacity: head(arrays.heads.opacity, "opacity", 1)?,
            sh: head(arrays.heads.sh, "sh", 48)?,
        })
    }
}

impl<F: DeformationField> DynamicScene<F> {
    /// Copies the model to what a `.l4gs` file holds.
    pub fn to_arrays(&self, meta: SceneMeta) -> SceneData {
        SceneData {
            meta,
            gaussians: self.gaussians.to_arrays(),
            frame: self.coordinates.to_arrays(),
            hexplane: self.planes().map(HexPlane::to_arrays).unwrap_or_default(),
            deformation: self.field.to_arrays(),
        }
    }

    /// The model of a decoded file, on any device.
    ///
    /// # Errors
    /// Planes or layers that do not belong together, or are not what this kind of field needs.
    pub fn from_arrays(data: &SceneData, device: &Device) -> Result<Self, ModelError> {
        let planes = match data.hexplane.planes.is_empty() {
            true => None,
            false => Some(HexPlane::from_arrays(&data.hexplane, device)?),
        };
        let SceneFrameArrays { mean, axes, std } = data.frame;
        Ok(Self {
            gaussians: Gaussians::from_arrays(&data.gaussians, device),
            coordinates: SceneCoordinates::new(&Pca { mean, axes, std }, device),
            field: F::from_arrays(&data.deformation, planes, device)?,
            differentiate_points: true,
        }
        .no_grad())
    }
}
