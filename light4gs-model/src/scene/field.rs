//! What moves the Gaussians: one trait, so that another motion model is another implementation.

use std::fmt::Debug;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Tensor, s};
use light4gs_codec::MotionArrays;

use super::arrays::ModelError;
use super::gaussians::GaussianTensors;
use super::hexplane::HexPlane;

/// A field of motion over the scene's coordinates and time (paper III-A).
///
/// [`HexPlaneField`](crate::HexPlaneField) is the paper's. [`DynamicScene`](crate::DynamicScene) is generic over the field, and so
/// are training, coding and decoding: a field of your own needs this trait and nothing else.
///
/// Why a module: its float parameters are found by Burn's visitors, so optimizers, checkpoints and gradients know them by
/// their paths (`field.…`, see [`parameters`](crate::parameters)) without being told.
pub trait DeformationField: Module + ModuleDisplay + 'static {
    /// What it is made from.
    type Config: Clone + Debug;

    /// Its name in a stream. A file of another kind is refused by this name.
    const KIND: &'static str;

    /// The field at the beginning of a training: it should move nothing much.
    fn init(config: &Self::Config, device: &Device) -> Self;

    /// Changes of the Gaussians at `points [N, 3]`, N > 0, in the scene's coordinates (each in [-1, 1]), at a time in [0, 1].
    /// Differentiable in points and parameters.
    fn offsets(&self, points: Tensor<2>, time: f32) -> Offsets;

    /// The feature planes, if the field has some. They are what the context model codes, what carries quantization noise in
    /// training and what the regularizers smooth. A field without planes has no plane rate and no context model.
    fn planes(&self) -> Option<&HexPlane> {
        None
    }

    /// [`Self::planes`], to replace them.
    fn planes_mut(&mut self) -> Option<&mut HexPlane> {
        None
    }

    /// What the stream holds of it, with [`Self::KIND`] as its kind: a network that the codec can run too, so that any
    /// program can tell where the Gaussians are, or plain tensors. Planes travel apart from it.
    fn to_arrays(&self) -> MotionArrays;

    /// The field of a decoded file of [`Self::KIND`]: its networks, and the planes if the file has some.
    ///
    /// # Errors
    /// A layer or plane that is missing, or of another shape than the others ask for.
    fn from_arrays(arrays: &MotionArrays, planes: Option<HexPlane>, device: &Device) -> Result<Self, ModelError>;
}

/// Changes to add to raw attributes of N Gaussians; absent where a field leaves an attribute alone.
#[derive(Clone, Debug, Default)]
pub struct Offsets {
    /// `[N, 3]`, world units.
    pub position: Option<Tensor<2>>,
    /// `[N, 3]`, logarithms.
    pub scale: Option<Tensor<2>>,
    /// `[N, 4]`, before normalization.
    pub rotation: Option<Tensor<2>>,
    /// `[N, 1]`, logits.
    pub opacity: Option<Tensor<2>>,
    /// `[N, 16, 3]`: degrees 0 to 3, of which as many are used as the Gaussians have.
    pub sh: Option<Tensor<3>>,
}

impl GaussianTensors {
    /// These attributes with the changes added.
    pub fn offset_by(self, offsets: Offsets) -> Self {
        fn add<const D: usize>(attribute: Tensor<D>, offset: Option<Tensor<D>>) -> Tensor<D> {
            match offset {
                Some(offset) => attribute + offset,
                None => attribute,
            }
        }
        let coefficients = self.sh_rest.dims()[1] + 1;
        let (dc, rest) = match offsets.sh {
            Some(sh) => (Some(sh.clone().slice(s![.., 0..1, ..])), Some(sh.slice(s![.., 1..coefficients, ..]))),
            None => (None, None),
        };
        Self {
            means: add(self.means, offsets.position),
            log_scales: add(self.log_scales, offsets.scale),
            quats: add(self.quats, offsets.rotation),
            opacity_logits: add(self.opacity_logits, offsets.opacity),
            sh_dc: add(self.sh_dc, dc),
            sh_rest: add(self.sh_rest, rest),
            further: self.further,
        }
    }
}
