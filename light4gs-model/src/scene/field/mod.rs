//! What moves the Gaussians: one trait, so that another motion model is another implementation.
//!
//! - here: [`DeformationField`], and what it is asked with
//! - `hexplane`, `deformation`: the paper's field, and its network
//! - `still`: nothing moves
//! - `built_in`: those of this crate as one type, of which a configuration or a file chooses one

mod built_in;
mod deformation;
mod hexplane;
mod still;

use std::collections::BTreeMap;
use std::fmt::Debug;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Tensor, s};
use light4gs_codec::MotionArrays;

pub use built_in::{BuiltInField, BuiltInFieldConfig};
pub use deformation::{Deformation, DeformationConfig, DeformationHead};
pub use hexplane::{HexPlaneField, HexPlaneFieldConfig};
pub use still::StillField;

use super::arrays::ModelError;
use super::attributes::Attribute;
use super::coordinates::SceneCoordinates;
use super::gaussians::{GaussianTensors, Gaussians};
use crate::planes::FeaturePlanes;

/// A field of motion over the scene and time (paper III-A).
///
/// [`HexPlaneField`](crate::HexPlaneField) is the paper's. [`DynamicScene`](crate::DynamicScene) is generic over the field, and so
/// are training, coding and decoding: a field of your own needs this trait and nothing else. Only the first three items must
/// be there to train and to evaluate; [`to_arrays`](Self::to_arrays) and [`from_arrays`](Self::from_arrays) are asked for
/// when a file is written and read.
///
/// Why a module: its float parameters are found by Burn's visitors, so optimizers, checkpoints and gradients know them by
/// their paths (`field.…`, see [`parameters`](crate::parameters)) without being told. A checkpoint holds the parameters and
/// nothing else of a field; a constant that a resumed run needs is a parameter that requires no gradient.
pub trait DeformationField: Module + ModuleDisplay + 'static {
    /// What it is made from.
    type Config: Clone + Debug;

    /// The names that it has in files and checkpoints: most fields have one. A file of another kind is refused by its name.
    const KINDS: &'static [&'static str];

    /// What every Gaussian must have for this field, besides what all of them have: see
    /// [`GaussianTensors::further`](crate::GaussianTensors::further). A field that needs something has it trained, coded and
    /// given back by saying so here.
    fn attributes(_config: &Self::Config) -> Vec<Attribute> {
        Vec::new()
    }

    /// The field at the beginning of a training: it should move nothing much.
    fn init(config: &Self::Config, device: &Device) -> Self;

    /// The Gaussians at a time in [0, 1]. `canonical` are the canonical ones, N > 0 of them, with all their attributes, positions
    /// in world units among it; `points [N, 3]` are their positions in the scene's coordinates, each in [-1, 1].
    /// Differentiable in all of them and in the parameters. What is only added to the Gaussians is an [`Offsets`], see
    /// [`GaussianTensors::offset_by`].
    fn deform(&self, canonical: GaussianTensors, points: Tensor<2>, time: f32) -> GaussianTensors;

    /// Which of [`Self::KINDS`] this one is.
    fn kind(&self) -> &'static str {
        Self::KINDS[0]
    }

    /// The fine stage begins: from now on the field moves the Gaussians, which the coarse stage has trained. The place to
    /// make parameters from them. Called once in a run: a run that is resumed in the fine stage takes from the checkpoint what
    /// was made here, see [`Self::resize`]. Planes may get other values here, but not another number or other sizes, since
    /// their entropy models are there already.
    fn begin_motion(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
        let _ = (scene, position);
    }

    /// An iteration of the fine stage begins. What is changed here is changed in the scene, so it counts in this iteration and
    /// later; shapes stay as they are, since the optimizer's moments belong to them.
    fn begin_step(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
        let _ = (scene, position);
    }

    /// A term `[1]` of the field's own in the loss of an iteration of the fine stage, weighted as it counts.
    fn regularizer(&self, scene: &SceneAtRest<'_>, position: &FinePosition) -> Option<Tensor<1>> {
        let _ = (scene, position);
        None
    }

    /// How fast the parameter at a path within the field (`deformation.trunk.0.weight`) is trained. `usual` is the
    /// configuration's rate of the deformation network. Not asked for planes.
    fn learning_rate(&self, path: &str, usual: LearningRate) -> LearningRate {
        let _ = path;
        usual
    }

    /// Gives the parameters the shapes that a checkpoint of the fine stage has, by their path within the field: a field needs
    /// this whose [`Self::begin_motion`] makes others than [`Self::init`] does. The checkpoint's numbers are taken over
    /// afterwards, so values do not matter. The shapes come from a file, where each belongs to as many numbers and has no
    /// side of 0; compare them with each other before making anything of several.
    ///
    /// # Errors
    /// Shapes that the field cannot have.
    fn resize(&mut self, shapes: &BTreeMap<String, Vec<usize>>) -> Result<(), ModelError> {
        let _ = shapes;
        Ok(())
    }

    /// The feature planes, if the field has some. They are what the context model codes, what carries quantization noise in
    /// training and what the regularizers smooth. A field without planes has no plane rate and no context model.
    fn planes(&self) -> Option<&FeaturePlanes> {
        None
    }

    /// [`Self::planes`], to replace them.
    fn planes_mut(&mut self) -> Option<&mut FeaturePlanes> {
        None
    }

    /// What the stream holds of it, under its [`Self::kind`]: a network that the codec can run too, so that any program can
    /// tell where the Gaussians are, or plain tensors. Planes travel apart from it.
    ///
    /// # Errors
    /// [`ModelError::NoStreamForm`] where this is not implemented.
    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        Err(ModelError::NoStreamForm { kind: self.kind(), action: "written to", method: "to_arrays" })
    }

    /// The field of a decoded file of one of [`Self::KINDS`]: its networks, and the planes if the file has some.
    ///
    /// # Errors
    /// A layer or plane that is missing, or of another shape than the others ask for; [`ModelError::NoStreamForm`] where this
    /// is not implemented.
    fn from_arrays(arrays: &MotionArrays, planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        let _ = (arrays, planes, device);
        Err(ModelError::NoStreamForm { kind: Self::KINDS[0], action: "read from", method: "from_arrays" })
    }
}

/// What a field moves, on the tape where autodiff is on.
#[derive(Clone, Copy, Debug)]
pub struct SceneAtRest<'a> {
    /// The canonical ones.
    pub gaussians: &'a Gaussians,
    /// From world coordinates to those that [`DeformationField::deform`] gets.
    pub coordinates: &'a SceneCoordinates,
    /// Radius of the cameras' positions, world units: what "large" is measured by.
    pub extent: f32,
}

/// Where a run stands in its fine stage when a field is asked.
#[derive(Clone, Copy, Debug)]
pub struct FinePosition {
    /// Iteration of the stage, from 1; 0 before the first one.
    pub iteration: usize,
    /// Iterations of the stage.
    pub iterations: usize,
    /// For random numbers: it depends on the run's seed and the iteration alone, so that a run that was resumed draws the
    /// same. The device's own generator is seeded with it as well before a field is asked.
    pub seed: u64,
}

/// How fast a parameter is trained: a rate of Adam that goes log-linearly from one end of the stage to the other. 0 at either
/// end means not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningRate {
    /// When the stage begins.
    pub initial: f64,
    /// When it ends.
    pub last: f64,
}

impl LearningRate {
    /// The same number of times as fast.
    pub fn times(self, factor: f64) -> Self {
        Self { initial: self.initial * factor, last: self.last * factor }
    }
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
