//! Linear blend skinning: Gaussians and nodes, moved Gaussians, gradients.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

/// Numbers of a node's pose: rotation matrix row by row (9), offset (3), quaternion (4).
pub(crate) const POSE: usize = 16;
/// Where a node's pose begins, behind its anchor (3) and precision (1).
pub(crate) const PLACE: usize = 4;
/// Numbers of a posed node before its affinities.
pub(crate) const POSED: usize = PLACE + POSE;
/// Numbers of a moved Gaussian: position (3), quaternion (4).
pub(crate) const MOVED: usize = 7;

/// Most affinities of a Gaussian and of a node.
pub const MOST_AFFINITIES: usize = 4;

/// The differentiable inputs, or their gradients, in the order that gradients are registered in.
#[derive(ExtensionType)]
pub struct SkinningTensors<B: Backend> {
    /// `[N, 3]`, world units.
    pub means: FloatTensor<B>,
    /// `[N, 4]`: quaternions (w, x, y, z) of any length.
    pub quats: FloatTensor<B>,
    /// `[N, 1]`, logits of the node that stands still.
    pub stillness: FloatTensor<B>,
    /// `[N, H]`.
    pub affinities: FloatTensor<B>,
    /// `[B, 20 + H]`: anchor (3), precision (1), pose (16): rotation matrix row by row (9), offset (3), quaternion (4); then
    /// affinities.
    pub nodes: FloatTensor<B>,
}

/// Tensors of [`SkinningTensors`].
pub(crate) const INPUTS: usize = 5;

impl<B: Backend> SkinningTensors<B> {
    pub(crate) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.means, self.quats, self.stillness, self.affinities, self.nodes]
    }

    pub(crate) fn from_array(tensors: [FloatTensor<B>; INPUTS]) -> Self {
        let [means, quats, stillness, affinities, nodes] = tensors;
        Self { means, quats, stillness, affinities, nodes }
    }
}

/// A back end's kernels. [`SkinningOps`](crate::ops::skinning::SkinningOps) adds the dispatch and the tape.
pub trait SkinningKernels: Backend {
    /// What the backward pass wants to see again.
    type Saved: Clone + Debug + Send + 'static;

    /// Positions and quaternions `[N, 7]`.
    fn skinning_forward(tensors: SkinningTensors<Self>) -> (FloatTensor<Self>, Self::Saved);

    /// Gradients of all inputs from that of the output `[N, 7]`.
    fn skinning_backward(saved: Self::Saved, gradient: FloatTensor<Self>) -> SkinningTensors<Self>;
}
