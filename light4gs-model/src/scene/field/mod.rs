//! What moves the Gaussians: one trait, which every deformation field implements.
//!
//! | scene | field |
//! |---|---|
//! | the paper's method; any motion, also of colors and opacities | [`HexPlaneField`](crate::HexPlaneField) |
//! | objects that are nearly rigid, in few bytes | [`NodesField`](crate::NodesField) |
//! | nothing moves | [`StillField`](crate::StillField) |
//! | the name is known only when the program runs, or is in a file | [`BuiltInField`](crate::BuiltInField): one of these |
//! | a motion of your own | another [`DeformationField`] |
//!
//! The files:
//!
//! - this file: [`DeformationField`], and its inputs
//! - `hexplane`, `deformation`: the paper's field, and its network
//! - `nodes`: control nodes, which Gaussians follow
//! - `still`: nothing moves
//! - `built_in`: the fields of this crate as one type, from which a configuration or a file chooses

mod built_in;
mod deformation;
mod hexplane;
mod nodes;
mod still;

use std::collections::BTreeMap;
use std::fmt::Debug;

use burn::module::{Module, ModuleDisplay};
use burn::tensor::{Device, Tensor, s};
use light4gs_codec::MotionArrays;

pub use built_in::{BuiltInField, BuiltInFieldConfig, FieldConfigs, FieldKind};
pub use deformation::{Deformation, DeformationConfig, DeformationHead};
pub use hexplane::{HexPlaneField, HexPlaneFieldConfig};
pub use nodes::{AFFINITY, LIFETIME, MOST_AFFINITIES, MOST_KNOTS, MOST_NODES, NodesField, NodesFieldConfig, STILLNESS};
pub use still::StillField;

use super::arrays::ModelError;
use super::attributes::Attribute;
use super::coordinates::SceneCoordinates;
use super::gaussians::{GaussianTensors, Gaussians};
use crate::planes::FeaturePlanes;

/// The positions of N Gaussians, for a field that works in the scene's coordinates. They are computed when it asks for them.
#[derive(Clone, Debug)]
pub struct ScenePoints<'a> {
    means: Tensor<2>,
    coordinates: &'a SceneCoordinates,
}

impl<'a> ScenePoints<'a> {
    /// From positions `[N, 3]` in world units.
    pub fn new(means: Tensor<2>, coordinates: &'a SceneCoordinates) -> Self {
        Self { means, coordinates }
    }

    /// The positions `[N, 3]` in the scene's coordinates, each in [-1, 1].
    pub fn normalized(self) -> Tensor<2> {
        self.coordinates.normalize(self.means)
    }

    /// The positions and a time in [0, 1] as coordinates of a hexplane, `[N, 4]`, each in [-1, 1].
    pub fn normalized_at(self, time: f32) -> Tensor<2> {
        self.coordinates.normalize_at(self.means, time)
    }
}

/// A deformation field over space and time (paper III-A).
///
/// [`HexPlaneField`](crate::HexPlaneField) is the paper's. [`DynamicScene`](crate::DynamicScene) is generic over the
/// field, and so are training, coding and decoding: a field of your own only has to implement this trait. To train and
/// to evaluate, only the first three items are needed; [`to_arrays`](Self::to_arrays) and
/// [`from_arrays`](Self::from_arrays) are called when a file is written and read.
///
/// It is a Burn module so that optimizers, checkpoints and gradients find its float parameters by Burn's visitors,
/// under their paths (`field.…`, see [`parameters`](crate::parameters)). A checkpoint holds only the parameters of a
/// field; a constant that a resumed run needs must be a parameter that requires no gradient.
pub trait DeformationField: Module + ModuleDisplay + 'static {
    /// The configuration from which it is made.
    type Config: Clone + Debug;

    /// Its names in files and checkpoints; most fields have one. A file of another kind is refused by its name.
    const KINDS: &'static [&'static str];

    /// Further attributes that this field needs: see [`GaussianTensors::further`](crate::GaussianTensors::further).
    /// They are trained, coded and decoded.
    fn attributes(_config: &Self::Config) -> Vec<Attribute> {
        Vec::new()
    }

    /// The field at the beginning of a training. It should move the Gaussians little or not at all.
    fn init(config: &Self::Config, device: &Device) -> Self;

    /// The Gaussians at a time in [0, 1]. `canonical` are the N > 0 canonical Gaussians with all their attributes,
    /// including positions in world units; `points` gives their positions `[N, 3]` in the scene's coordinates.
    /// Differentiable in all of them and in the parameters. A field that only adds to attributes can return
    /// [`GaussianTensors::offset_by`] of [`Offsets`].
    fn deform(&self, canonical: GaussianTensors, points: ScenePoints<'_>, time: f32) -> GaussianTensors;

    /// Which of [`Self::KINDS`] this one is.
    fn kind(&self) -> &'static str {
        Self::KINDS[0]
    }

    /// Called once in a run, when the fine stage begins: from now on the field moves the Gaussians, which the coarse
    /// stage has trained. Parameters that depend on these Gaussians are made here. A run that is resumed in the fine
    /// stage reads such parameters from the checkpoint instead, see [`Self::resize`]. Values of planes may be changed
    /// here, but not their number or sizes, since their entropy models exist already.
    fn begin_motion(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
        let _ = (scene, position);
    }

    /// Called before each iteration of the fine stage. Changes of values stay in the scene for this iteration and later
    /// ones. Shapes must not change, since the optimizer's moments belong to them.
    fn begin_step(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
        let _ = (scene, position);
    }

    /// The numbers of a further attribute for a Gaussian that stands still and is there around one moment only. `None`: as
    /// the attribute starts.
    fn passing(&self, attribute: &Attribute, moment: &Moment) -> Option<Vec<f32>> {
        let _ = (attribute, moment);
        None
    }

    /// The field's own term `[1]` of the loss in an iteration of the fine stage, already weighted.
    fn regularizer(&self, scene: &SceneAtRest<'_>, position: &FinePosition) -> Option<Tensor<1>> {
        let _ = (scene, position);
        None
    }

    /// The learning rate of the parameter at a path within the field (`deformation.trunk.0.weight`). `usual` is the
    /// configured rate of the deformation network. Not called for planes.
    fn learning_rate(&self, path: &str, usual: LearningRate) -> LearningRate {
        let _ = path;
        usual
    }

    /// Gives the parameters the shapes that they have in a checkpoint of the fine stage, by their paths within the
    /// field. A field needs this if its [`Self::begin_motion`] makes parameters of other shapes than [`Self::init`]
    /// does. The values are read from the checkpoint afterwards. The shapes come from a file. Each agrees with the
    /// number of its values and has no axis of length 0, but shapes must be compared with each other before memory is
    /// taken.
    ///
    /// # Errors
    /// [`ModelError::Motion`] for shapes that the field cannot have.
    fn resize(&mut self, shapes: &BTreeMap<String, Vec<usize>>) -> Result<(), ModelError> {
        let _ = shapes;
        Ok(())
    }

    /// The feature planes, if the field has any. The context model codes them, training adds quantization noise to
    /// them, and the regularizers smooth them. A field without planes has no rate of planes and no context model.
    fn planes(&self) -> Option<&FeaturePlanes> {
        None
    }

    /// [`Self::planes`], for replacing them.
    fn planes_mut(&mut self) -> Option<&mut FeaturePlanes> {
        None
    }

    /// The field's data for the stream, under its [`Self::kind`]: a network that the codec can run too, so that any
    /// program can compute the Gaussians at a time, or plain tensors. Planes are stored separately.
    ///
    /// # Errors
    /// [`ModelError::NoStreamForm`] where this is not implemented.
    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        Err(ModelError::NoStreamForm { kind: self.kind(), action: "written to", method: "to_arrays" })
    }

    /// The field of a decoded file of one of [`Self::KINDS`]: from its networks, and the planes if the file has any.
    ///
    /// # Errors
    /// A layer or plane that is missing, or whose shape does not fit the others; [`ModelError::NoStreamForm`] where
    /// this is not implemented.
    fn from_arrays(arrays: &MotionArrays, planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        let _ = (arrays, planes, device);
        Err(ModelError::NoStreamForm { kind: Self::KINDS[0], action: "read from", method: "from_arrays" })
    }
}

/// The scene that a field moves, on the tape where autodiff is on.
#[derive(Clone, Copy, Debug)]
pub struct SceneAtRest<'a> {
    /// The canonical Gaussians.
    pub gaussians: &'a Gaussians,
    /// From world coordinates to those that [`DeformationField::deform`] gets.
    pub coordinates: &'a SceneCoordinates,
    /// Extent of the scene, world units: 1.1 times the largest distance of a training camera from their mean.
    pub extent: f32,
}

/// The time around which a short-lived Gaussian exists: a bell curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Its middle, in [0, 1].
    pub time: f32,
    /// Its standard deviation, above 0.
    pub deviation: f32,
}

/// The position of a run in its fine stage when a field is called.
#[derive(Clone, Copy, Debug)]
pub struct FinePosition {
    /// Iteration of the stage, from 1; 0 before the first one.
    pub iteration: usize,
    /// Iterations of the stage.
    pub iterations: usize,
    /// Different times that the training frames have.
    pub times: usize,
    /// From the earliest to the latest time that the sampler shows at this iteration.
    pub window: [f32; 2],
    /// The same at the iteration before.
    pub window_before: [f32; 2],
    /// Seed for random numbers. It depends only on the run's seed and the iteration, so that a resumed run draws the
    /// same. Before a field is called, the device's own generator is seeded with it as well.
    pub seed: u64,
}

impl FinePosition {
    /// Whether the window holds all times.
    pub fn shows_all(&self) -> bool {
        holds_all(self.window)
    }

    /// Whether the window held all times before, and does so no longer: a survey has ended.
    pub fn narrows(&self) -> bool {
        holds_all(self.window_before) && !holds_all(self.window)
    }

    /// A time in the window, another one in each iteration.
    pub fn random_time(&self) -> f32 {
        let [low, high] = self.window;
        // The top bits of the seed as a number in [0, 1).
        let share = (self.seed >> 40) as f32 / (1 << 24) as f32;
        low + share * (high - low)
    }
}

fn holds_all([low, high]: [f32; 2]) -> bool {
    low <= 0.0 && high >= 1.0
}

/// The learning rate of a parameter: Adam's rate, interpolated log-linearly from the beginning of the stage to its end.
/// 0 at either end means that the parameter is not trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningRate {
    /// At the beginning of the stage.
    pub initial: f64,
    /// At its end.
    pub last: f64,
}

impl LearningRate {
    /// Multiplied by a factor.
    pub fn times(self, factor: f64) -> Self {
        Self { initial: self.initial * factor, last: self.last * factor }
    }
}

/// Changes to add to raw attributes of N Gaussians; `None` for attributes that the field does not change.
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
    /// `[N, 16, 3]`: degrees 0 to 3; those beyond the Gaussians' degree are ignored.
    pub sh: Option<Tensor<3>>,
}

impl GaussianTensors {
    /// These attributes plus the changes.
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
