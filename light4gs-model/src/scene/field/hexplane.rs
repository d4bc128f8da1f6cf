//! The paper's field: a feature of the multiscale hexplane, and a small network that turns it into changes (III-A).

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::{CodecError, MotionArrays};
use light4gs_keys::keys;

use super::deformation::{Deformation, DeformationConfig};
use super::{DeformationField, Offsets, ScenePoints};
use crate::planes::{FeaturePlanes, HexPlaneConfig};
use crate::scene::{GaussianTensors, ModelError};

keys! {
    /// The paper's field: multiscale hexplane and network.
    pub struct HexPlaneFieldConfig {
        /// The feature planes.
        hexplane: HexPlaneConfig;
        /// The network that turns features into motion.
        deformation: DeformationConfig;
    }
}

/// Features over space and time, and the network that turns them into changes.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::*;
///
/// let device = Device::flex();
/// let hexplane = HexPlaneConfig { channels: 4, resolution: [8, 8, 8, 4], ..Default::default() };
/// let deformation = DeformationConfig { width: 16, ..Default::default() };
/// let config = HexPlaneFieldConfig { hexplane, deformation };
/// let field = HexPlaneField::init(&config, &device);
/// let offsets = field.offsets(Tensor::zeros([5, 4], &device));
/// assert_eq!(offsets.position.unwrap().dims(), [5, 3]);
/// ```
#[derive(Module, Debug)]
pub struct HexPlaneField {
    /// Features over space and time.
    pub hexplane: FeaturePlanes,
    /// From features to changes.
    pub deformation: Deformation,
}

impl HexPlaneFieldConfig {
    /// Refuses a network that no stream can hold: see [`DeformationConfig::check_size`].
    ///
    /// # Errors
    /// More weights, or more channels of all values together, than a network may have.
    pub fn check_size(&self) -> Result<(), CodecError> {
        let features = self.hexplane.channels.saturating_mul(self.hexplane.multipliers.len());
        self.deformation.check_size(features)
    }
}

impl HexPlaneField {
    /// Changes of Gaussians at the hexplane's coordinates `[N, 4]` of positions and time, N > 0, each in [-1, 1].
    pub fn offsets(&self, coordinates: Tensor<2>) -> Offsets {
        self.deformation.forward(self.hexplane.query(coordinates))
    }
}

impl DeformationField for HexPlaneField {
    type Config = HexPlaneFieldConfig;

    const KINDS: &'static [&'static str] = &["hexplane"];

    fn init(config: &HexPlaneFieldConfig, device: &Device) -> Self {
        let hexplane = config.hexplane.init(device);
        let deformation = config.deformation.init(hexplane.feature_size(), device);
        Self { hexplane, deformation }
    }

    fn deform(&self, canonical: GaussianTensors, points: ScenePoints<'_>, time: f32) -> GaussianTensors {
        canonical.offset_by(self.offsets(points.normalized_at(time)))
    }

    fn planes(&self) -> Option<&FeaturePlanes> {
        Some(&self.hexplane)
    }

    fn planes_mut(&mut self) -> Option<&mut FeaturePlanes> {
        Some(&mut self.hexplane)
    }

    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        let network = Some(self.deformation.to_motion());
        Ok(MotionArrays { kind: self.kind().to_owned(), network, tensors: Vec::new() })
    }

    fn from_arrays(arrays: &MotionArrays, planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        let hexplane = planes.ok_or_else(|| ModelError::Planes("none, but a hexplane field needs some".into()))?;
        let motion = arrays.network.as_ref().ok_or_else(|| ModelError::Motion("no network".into()))?;
        let deformation = Deformation::from_motion(motion, hexplane.feature_size(), device)?;
        Ok(Self { hexplane, deformation })
    }
}
