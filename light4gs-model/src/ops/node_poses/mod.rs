//! Poses of control nodes on splines over time, as a Burn operation.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;
pub(super) mod motion;
pub(super) mod spline;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// The parameters of the nodes. Lengths are shares of the unit.
#[derive(ExtensionType)]
pub struct NodeTensors<B: Backend> {
    /// `[B, 3]`.
    pub anchors: FloatTensor<B>,
    /// `[B, 1]`.
    pub log_radii: FloatTensor<B>,
    /// `[K, 3 B]`, the three of a node behind each other.
    pub translations: FloatTensor<B>,
    /// `[K, 4 B]`, the four of a node behind each other: a quaternion (w, x, y, z) less (1, 0, 0, 0).
    pub rotations: FloatTensor<B>,
    /// `[B, H]`; where there are none, a placeholder that is not read.
    pub affinities: FloatTensor<B>,
    /// `[1]`, a constant: world units.
    pub unit: FloatTensor<B>,
}

/// Tensors of [`NodeTensors`], and those of them that are learned: all but the last.
const INPUTS: usize = 6;
const LEARNED: usize = 5;

impl<B: Backend> NodeTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.anchors, self.log_radii, self.translations, self.rotations, self.affinities, self.unit]
    }

    fn from_array([anchors, log_radii, translations, rotations, affinities, unit]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { anchors, log_radii, translations, rotations, affinities, unit }
    }
}

/// Time and size of the poses.
#[derive(Clone, Copy, Debug)]
pub struct Posing {
    /// In [0, 1].
    pub time: f32,
    /// A node's affinities, 0 to [`MOST_AFFINITIES`](super::skinning::MOST_AFFINITIES).
    pub affinities: usize,
}

/// A back end's kernels. [`NodePoseOps`] adds the dispatch and the tape.
pub trait NodePoseKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Posed: Clone + Debug + Send + 'static;

    /// Posed nodes `[B, 20 + H]`.
    fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (FloatTensor<Self>, Self::Posed);

    /// From the gradient of the output to those of all parameters but the unit, in their order. That of a placeholder means nothing.
    fn node_poses_backward(saved: Self::Posed, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; LEARNED];
}

/// Poses on every back end that has [`NodePoseKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NodePoseOps: Backend {
    /// Posed nodes `[B, 20 + H]`; see [`pose`].
    fn node_poses(#[extension_type] nodes: NodeTensors<Self>, posing: Posing) -> FloatTensor<Self>;
}

for_all_back_ends! {
    NodePoseOps with NodePoseKernels {
        fn node_poses(nodes: NodeTensors<Self>, posing: Posing) -> FloatTensor<Self> {
            Self::node_poses_forward(nodes, posing).0
        }
    }
}

impl<B: NodePoseOps + NodePoseKernels, C: CheckpointStrategy> NodePoseOps for Autodiff<B, C> {
    fn node_poses(nodes: NodeTensors<Self>, posing: Posing) -> FloatTensor<Self> {
        let tensors = nodes.into_array();
        let parents = std::array::from_fn(|k| tensors[k].node());
        let inner = NodeTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        recorded::<B, C, _, _>(parents, B::node_poses_forward(inner, posing), B::node_poses_backward)
    }
}

/// The parameters of B control nodes. Lengths are shares of the unit.
#[derive(Clone, Debug)]
pub struct NodeParameters {
    /// `[B, 3]`: places of the nodes at rest.
    pub anchors: Tensor<2>,
    /// `[B, 1]`: logarithms of their radii.
    pub log_radii: Tensor<2>,
    /// `[K, 3 B]`: knots of their translations, the three numbers of a node behind each other; K is 4 or more.
    pub translations: Tensor<2>,
    /// `[K, 4 B]`: knots of their rotations, the four numbers of a node behind each other: quaternions (w, x, y, z), of any
    /// length, less (1, 0, 0, 0).
    pub rotations: Tensor<2>,
    /// `[B, H]`: their own affinities, if Gaussians have any.
    pub affinities: Option<Tensor<2>>,
    /// `[1]`, a constant, which gets no gradient: world units.
    pub unit: Tensor<1>,
}

impl NodeParameters {
    /// Panics where shapes do not belong together.
    pub(super) fn check(&self) {
        let (count, knots) = (self.anchors.dims()[0], self.translations.dims()[0]);
        assert!(count > 0, "anchors must have one row or more");
        assert!(knots > 3, "translations must have four rows or more");
        assert_eq!(self.anchors.dims(), [count, 3], "anchors must be [B, 3]");
        assert_eq!(self.log_radii.dims(), [count, 1], "log_radii must be [B, 1]");
        assert_eq!(self.translations.dims(), [knots, 3 * count], "translations must be [K, 3 B]");
        assert_eq!(self.rotations.dims(), [knots, 4 * count], "rotations must be [K, 4 B]");
        if let Some(affinities) = &self.affinities {
            assert_eq!(affinities.dims()[0], count, "affinities must be [B, H]");
        }
        assert_eq!(self.unit.dims(), [1], "unit must be [1]");
    }
}

/// The nodes at a time in [0, 1], `[B, 20 + H]`, as [`skin`](super::skinning::skin) takes them. Trajectories are uniform cubic
/// B-splines, the quaternions of which are normalized afterwards; a node turns about its anchor:
///
/// ```text
/// R = rotation of q,   q = normalized((1, 0, 0, 0) + spline of the rotations)
/// offset = unit · (anchor + spline of the translations - R anchor)
/// ```
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::node_poses::{NodeParameters, pose};
///
/// let device = Device::flex();
/// // One node in a scene of two meters, which goes its whole way along z and does not turn.
/// let nodes = NodeParameters {
///     anchors: Tensor::from_floats([[0.5, 0.0, 0.0]], &device),
///     log_radii: Tensor::zeros([1, 1], &device),
///     translations: Tensor::from_floats([[0.0, 0.0, -1.0], [0.0; 3], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]], &device),
///     rotations: Tensor::zeros([4, 4], &device),
///     affinities: None,
///     unit: Tensor::from_floats([2.0], &device),
/// };
/// let posed = pose(nodes, 1.0).into_data().to_vec::<f32>().unwrap();
/// assert_eq!(posed[..4], [1.0, 0.0, 0.0, 0.125]);
/// assert_eq!(posed[4..16], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0]);
/// ```
///
/// # Panics
/// If the shapes do not belong together, or there is no node; the message names the tensor.
pub fn pose(nodes: NodeParameters, time: f32) -> Tensor<2> {
    nodes.check();
    let NodeParameters { anchors, log_radii, translations, rotations, affinities, unit } = nodes;
    let posing = Posing { time, affinities: affinities.as_ref().map_or(0, |affinities| affinities.dims()[1]) };
    let affinities = affinities.unwrap_or_else(|| log_radii.clone().detach());
    Tensor::from_dispatch(Dispatch::node_poses(
        NodeTensors {
            anchors: anchors.into_dispatch(),
            log_radii: log_radii.into_dispatch(),
            translations: translations.into_dispatch(),
            rotations: rotations.into_dispatch(),
            affinities: affinities.into_dispatch(),
            unit: unit.into_dispatch(),
        },
        posing,
    ))
}
