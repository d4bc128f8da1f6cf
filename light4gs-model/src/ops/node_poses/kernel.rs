//! Control nodes at a time: their parameters, posed nodes, gradients.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

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
pub(crate) const INPUTS: usize = 6;
pub(crate) const LEARNED: usize = 5;

impl<B: Backend> NodeTensors<B> {
    pub(crate) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.anchors, self.log_radii, self.translations, self.rotations, self.affinities, self.unit]
    }

    pub(crate) fn from_array(
        [anchors, log_radii, translations, rotations, affinities, unit]: [FloatTensor<B>; INPUTS],
    ) -> Self {
        Self { anchors, log_radii, translations, rotations, affinities, unit }
    }
}

/// What the nodes are posed for.
#[derive(Clone, Copy, Debug)]
pub struct Posing {
    /// In [0, 1].
    pub time: f32,
    /// A node's affinities, 0 to [`MOST_AFFINITIES`](super::skinning::MOST_AFFINITIES).
    pub affinities: usize,
}

/// A back end's kernels. [`NodePoseOps`](crate::ops::node_poses::NodePoseOps) adds the dispatch and the tape.
pub trait NodePoseKernels: Backend {
    /// What the backward pass wants to see again.
    type Posed: Clone + Debug + Send + 'static;

    /// Posed nodes `[B, 20 + H]`.
    fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (FloatTensor<Self>, Self::Posed);

    /// From the gradient of the output to those of all parameters but the unit, in their order. That of a placeholder means nothing.
    fn node_poses_backward(saved: Self::Posed, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; LEARNED];
}
