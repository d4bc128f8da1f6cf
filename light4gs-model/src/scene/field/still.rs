//! No motion: plain Gaussians, for static scenes.

use burn::module::Module;
use burn::tensor::Device;
use light4gs_codec::MotionArrays;

use super::{DeformationField, ScenePoints};
use crate::planes::FeaturePlanes;
use crate::scene::{GaussianTensors, ModelError};

/// A field that moves nothing.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::PointCloud;
/// use light4gs_model::{DynamicSceneConfig, GaussiansConfig, StillField};
///
/// let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
/// let scene = DynamicSceneConfig::<StillField>::new(GaussiansConfig::new(), ()).init(&cloud, &Device::flex());
/// assert_eq!(scene.at(0.25).means.into_data(), scene.gaussians.means.val().into_data());
/// ```
#[derive(Module, Debug)]
pub struct StillField;

impl DeformationField for StillField {
    type Config = ();

    /// In a stream, the kind of a scene without motion is empty.
    const KINDS: &'static [&'static str] = &[""];

    fn init((): &(), _: &Device) -> Self {
        Self
    }

    fn deform(&self, canonical: GaussianTensors, _: ScenePoints<'_>, _: f32) -> GaussianTensors {
        canonical
    }

    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        Ok(MotionArrays::default())
    }

    fn from_arrays(_: &MotionArrays, _: Option<FeaturePlanes>, _: &Device) -> Result<Self, ModelError> {
        Ok(Self)
    }
}
