//! Control nodes: few rigid bodies with a trajectory each, and Gaussians that follow those around them.
//!
//! A node has a place (its anchor), a radius, and a rotation and translation over time. A Gaussian follows the nodes by linear
//! blend skinning, weighted by its distance from their anchors before anything moves; a learned share of it stands still.
//! Textures turn with their object, and motion costs the same bytes however many Gaussians there are. After
//! SC-GS (Huang et al., CVPR 2024), with splines in place of its network.
//!
//! | file | contents |
//! |---|---|
//! | `trajectory` | trajectories over time, and the places of nodes on them |
//! | `placement` | the places of the nodes when motion begins |
//! | `survey` | the ways of objects, found at all times before a window widens |
//! | `affinity` | nodes that a Gaussian follows more than its distance says |
//! | `lifetime` | Gaussians that come and go |
//! | `stream` | the same as operations of the codec, in a file |
//! | `plain` | nodes, Gaussians and poses as plain numbers |
//! | `weights` | the weights of the skinning, as numbers |

mod affinity;
mod lifetime;
mod placement;
mod plain;
mod stream;
mod survey;
mod trajectory;
mod weights;

use std::collections::BTreeMap;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_codec::MotionArrays;
use light4gs_keys::Bounds::{self, Flag, Number, Whole};
use light4gs_keys::{WEIGHT, keys};

pub use affinity::AFFINITY;
pub use lifetime::LIFETIME;

use super::{DeformationField, FinePosition, LearningRate, Moment, SceneAtRest, ScenePoints};
use crate::ops::node_poses::{NodeParameters, pose};
use crate::ops::node_regularizer::{Regularization, regularize};
pub use crate::ops::skinning::MOST_AFFINITIES;
use crate::ops::skinning::{Moved, SkinningInputs, skin};
use crate::planes::FeaturePlanes;
use crate::scene::{Attribute, GaussianTensors, ModelError};

/// The attribute for the share of a Gaussian that stands still, `[N, 1]`: the logit of a node that never moves.
pub const STILLNESS: &str = "stillness";

/// Most nodes of a field.
pub const MOST_NODES: usize = 512;
/// Most knots of a trajectory.
pub const MOST_KNOTS: usize = 512;

/// Learning rate of stillness, and its step in a file.
const STILLNESS_RATE: f64 = 0.02;
const STILLNESS_STEP: f64 = 0.25;
/// A logit of standing still whose weight is next to 1.
const FIRMLY_STILL: f32 = 8.0;
/// A logit of standing still whose weight is 0.
const NEVER_STILL: f32 = -1e30;

const FACTOR: Bounds = Number { least: 0.0, most: 1e3 };

keys! {
    /// Control nodes, and their trajectories.
    pub struct NodesFieldConfig {
        /// Number of nodes; never more than there are Gaussians.
        count: usize = 32; Whole { least: 1, most: MOST_NODES as u64 }, "ours; SC-GS: 512";
        /// Distance in time from one knot of a trajectory to the next, counted in points of time that have training
        /// frames.
        times_a_knot: f64 = 4.0; Number { least: 0.1, most: 1e6 }, "ours";
        /// A node's radius at the beginning, as a share of the distance to the nearest other node.
        radius: f64 = 0.6; Number { least: 0.01, most: 100.0 }, "ours";
        /// Nodes are placed at Gaussians with at least this opacity.
        opacity: f64 = 0.15; Number { least: 1e-4, most: 0.999 }, "ours";
        /// Whether every Gaussian learns a stillness, which is its skinning logit for an additional node that never
        /// moves.
        stillness: bool = true; Flag, "ours";
        /// Stillness at the beginning. For comparison: a Gaussian at a node's anchor has a skinning logit of 0 for that
        /// node.
        stillness_start: f64 = -4.0; Number { least: -30.0, most: 30.0 }, "ours";
        /// Whether every Gaussian learns a lifetime, a bell curve over time by which its opacity is multiplied.
        /// Lifetimes have no effect before the iteration at which the sampler's window of time holds all times.
        lifetime: bool = false; Flag, "ours";
        /// Length of the affinities, which are learned vectors of Gaussians and of nodes. The inner product of a
        /// Gaussian's and a node's affinity is added to the logit of the skinning weight. So a foot and the floor under
        /// it can follow different nodes.
        affinities: usize = 0; Whole { least: 0, most: MOST_AFFINITIES as u64 }, "after SC-GS";
        /// Weight of the as-rigid-as-possible term of the loss. This term pulls each node to the place that follows
        /// from the rigid motions of the nodes near it.
        rigidity: f64 = 1.0; WEIGHT, "ours; SC-GS: 1e-4 to 0";
        /// Weight of the squared second differences of trajectories.
        smoothness: f64 = 0.1; WEIGHT, "ours";
        /// Learning rate of the nodes' translations as a multiple of the deformation's learning rate. Translations are
        /// in shares of the scene's extent.
        translation_rate: f64 = 2.0; FACTOR, "ours";
        /// Learning rate of the nodes' rotations as a multiple of the deformation's learning rate.
        rotation_rate: f64 = 8.0; FACTOR, "ours";
        /// Learning rate of the nodes' anchors and radii as a multiple of the deformation's learning rate.
        anchor_rate: f64 = 5.0; FACTOR, "ours";
    }
}

/// `B` nodes on trajectories of `K` knots. Lengths are shares of `unit`.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_data::PointCloud;
/// use light4gs_model::{DynamicSceneConfig, GaussiansConfig, NodesField, NodesFieldConfig};
///
/// let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
/// let config = DynamicSceneConfig::<NodesField>::new(GaussiansConfig::new(), NodesFieldConfig::default());
/// // Until motion begins there is one node, which does not move.
/// let scene = config.init(&cloud, &Device::flex());
/// let moved = scene.at(0.25).means - scene.gaussians.means.val();
/// assert!(moved.abs().max().into_scalar::<f32>() < 1e-6);
/// ```
#[derive(Module, Debug)]
pub struct NodesField {
    /// `[B, 3]`.
    anchors: Param<Tensor<2>>,
    /// `[B, 1]`: logarithms of the radii.
    log_radii: Param<Tensor<2>>,
    /// `[K, 3 B]`, the three of a node behind each other: its translation.
    translations: Param<Tensor<2>>,
    /// `[K, 4 B]`, the four of a node behind each other: its rotation, a quaternion (w, x, y, z) less (1, 0, 0, 0).
    rotations: Param<Tensor<2>>,
    /// `[B, H]`: the nodes' own affinities, where Gaussians have any.
    affinities: Option<Param<Tensor<2>>>,
    /// `[1 + K, 3 B]`, constants: after a survey, the middle of each node's object before anything moves, and knots of its way.
    ways: Option<Param<Tensor<2>>>,
    /// `[1]`, a constant: the scene's extent, world units.
    unit: Param<Tensor<1>>,
    #[module(skip)]
    config: NodesFieldConfig,
    /// Whether lifetimes apply. Before all times are seen, an object that is lost shall be found again, not fade.
    #[module(skip)]
    fades: bool,
}

impl NodesField {
    fn zeros(config: NodesFieldConfig, nodes: usize, knots: usize, device: &Device) -> Self {
        let zeros = |shape: [usize; 2]| Param::from_tensor(Tensor::zeros(shape, device));
        Self {
            anchors: zeros([nodes, 3]),
            log_radii: zeros([nodes, 1]),
            translations: zeros([knots, 3 * nodes]),
            rotations: zeros([knots, 4 * nodes]),
            affinities: (config.affinities > 0).then(|| zeros([nodes, config.affinities])),
            ways: None,
            unit: Param::from_tensor(Tensor::ones([1], device)).set_require_grad(false),
            config,
            fades: true,
        }
    }

    /// Nodes.
    pub fn nodes(&self) -> usize {
        self.anchors.dims()[0]
    }

    /// Knots of a trajectory.
    pub fn knots(&self) -> usize {
        self.translations.dims()[0]
    }

    fn parameters(&self) -> NodeParameters {
        NodeParameters {
            anchors: self.anchors.val(),
            log_radii: self.log_radii.val(),
            translations: self.translations.val(),
            rotations: self.rotations.val(),
            affinities: self.affinities.as_ref().map(|affinities| affinities.val()),
            unit: self.unit.val(),
        }
    }

    /// Moved positions and quaternions, from the nodes `[B, 20 + H]` at a time.
    fn skinned(&self, canonical: &GaussianTensors, nodes: Tensor<2>) -> Moved {
        let stillness = canonical.further(STILLNESS).cloned();
        let stillness = stillness
            .unwrap_or_else(|| Tensor::full([canonical.means.dims()[0], 1], NEVER_STILL, &canonical.means.device()));
        let inputs = SkinningInputs::new(canonical.means.clone(), canonical.quats.clone(), stillness, nodes);
        skin(SkinningInputs { affinities: canonical.further(AFFINITY).cloned(), ..inputs })
    }

    /// The number of knots for `times` different training times.
    fn knots_of(config: &NodesFieldConfig, times: usize) -> usize {
        let segments = (times as f64 / config.times_a_knot).ceil() as usize;
        (segments + 3).clamp(4, MOST_KNOTS)
    }
}

impl DeformationField for NodesField {
    type Config = NodesFieldConfig;

    const KINDS: &'static [&'static str] = &["nodes"];

    fn attributes(config: &NodesFieldConfig) -> Vec<Attribute> {
        let stillness = || {
            let attribute = Attribute::new(STILLNESS, 1).with_start(vec![config.stillness_start as f32]).constant();
            attribute.with_learning_rate(STILLNESS_RATE).with_step(STILLNESS_STEP)
        };
        let stillness = config.stillness.then(stillness);
        let affinity = (config.affinities > 0).then(|| affinity::attribute(config.affinities));
        let lifetime = config.lifetime.then(lifetime::attribute);
        stillness.into_iter().chain(affinity).chain(lifetime).collect()
    }

    /// One node that does not move, until there is a cloud to make more from.
    fn init(config: &NodesFieldConfig, device: &Device) -> Self {
        Self::zeros(config.clone(), 1, 4, device)
    }

    /// Weights take positions as constants: a Gaussian does not move only to follow another node.
    fn deform(&self, canonical: GaussianTensors, _: ScenePoints<'_>, time: f32) -> GaussianTensors {
        let Moved { means, quats } = self.skinned(&canonical, pose(self.parameters(), time));
        let opacity_logits = match canonical.further(LIFETIME) {
            Some(lifetime) if self.fades => lifetime::faded(&canonical.opacity_logits, lifetime.clone(), time),
            _ => canonical.opacity_logits.clone(),
        };
        GaussianTensors { means, quats, opacity_logits, ..canonical }
    }

    fn begin_motion(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
        *self = self.placed(scene, position);
    }

    /// Continues the knots that the window does not show: on the ways of the survey, or, without a survey, in the direction
    /// of the knots that it does show.
    fn begin_step(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
        self.fades = position.shows_all();
        if self.fades {
            return;
        }
        if position.narrows() {
            self.survey(scene, position.window);
        }
        let [low, high] = position.window;
        let renewed =
            |knots: &Param<Tensor<2>>, value: Tensor<2>| Param::initialized(knots.id, value.detach().require_grad());
        self.rotations = renewed(&self.rotations, trajectory::continued(self.rotations.val(), low, high));
        let translations = self.translations_beyond(low, high);
        let translations = translations.unwrap_or_else(|| trajectory::continued(self.translations.val(), low, high));
        self.translations = renewed(&self.translations, translations);
    }

    fn passing(&self, attribute: &Attribute, moment: &Moment) -> Option<Vec<f32>> {
        match &*attribute.name {
            LIFETIME => Some(lifetime::of(moment)),
            STILLNESS => Some(vec![FIRMLY_STILL]),
            _ => None,
        }
    }

    fn regularizer(&self, _: &SceneAtRest<'_>, position: &FinePosition) -> Option<Tensor<1>> {
        let [rigidity, smoothness] = [self.config.rigidity, self.config.smoothness].map(|weight| weight as f32);
        let regularization = Regularization { rigidity, smoothness, time: position.random_time() };
        (rigidity > 0.0 || smoothness > 0.0).then(|| regularize(self.parameters(), regularization))
    }

    fn learning_rate(&self, path: &str, usual: LearningRate) -> LearningRate {
        usual.times(match path {
            "translations" => self.config.translation_rate,
            "rotations" => self.config.rotation_rate,
            _ => self.config.anchor_rate,
        })
    }

    fn resize(&mut self, shapes: &BTreeMap<String, Vec<usize>>) -> Result<(), ModelError> {
        let rows = |name: &str| shapes.get(name).and_then(|shape| shape.first().copied()).unwrap_or(0);
        let (nodes, knots) = (rows("anchors"), rows("translations"));
        if !(1..=MOST_NODES).contains(&nodes) || !(4..=MOST_KNOTS).contains(&knots) {
            let expected = format!("expected 1 to {MOST_NODES} and 4 to {MOST_KNOTS}");
            return Err(ModelError::Motion(format!("{nodes} nodes with {knots} knots, {expected}")));
        }
        *self = Self::zeros(self.config.clone(), nodes, knots, &self.anchors.device());
        if shapes.contains_key("ways") {
            let zeros = Tensor::zeros([1 + knots, 3 * nodes], &self.anchors.device());
            self.ways = Some(Param::from_tensor(zeros).set_require_grad(false));
        }
        Ok(())
    }

    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        Ok(self.describe())
    }

    fn from_arrays(arrays: &MotionArrays, _: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        Self::of_description(arrays, device)
    }
}

/// Rows of a tensor that stands on a device, from numbers.
fn tensor(numbers: Vec<f32>, shape: [usize; 2], device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(numbers, shape), device)
}

/// Numbers of a tensor, row by row.
fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter().collect()
}
