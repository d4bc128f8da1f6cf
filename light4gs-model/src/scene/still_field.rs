//! No motion at all: plain Gaussians, for those who only want them small.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::MotionArrays;

use super::arrays::ModelError;
use super::field::{DeformationField, Offsets};
use super::hexplane::HexPlane;

/// A field that moves nothing.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::{DeformationField, StillField};
///
/// let device = Device::flex();
/// let offsets = StillField::init(&(), &device).offsets(Tensor::zeros([5, 3], &device), 0.25);
/// assert!(offsets.position.is_none());
/// ```
#[derive(Module, Debug)]
pub struct StillField;

impl DeformationField for StillField {
    type Config = ();

    /// A stream in which nothing moves has no name for it.
    const KIND: &'static str = "";

    fn init((): &(), _: &Device) -> Self {
        Self
    }

    fn offsets(&self, _: Tensor<2>, _: f32) -> Offsets {
        Offsets::default()
    }

    fn to_arrays(&self) -> MotionArrays {
        MotionArrays::default()
    }

    fn from_arrays(_: &MotionArrays, _: Option<HexPlane>, _: &Device) -> Result<Self, ModelError> {
        Ok(Self)
    }
}
