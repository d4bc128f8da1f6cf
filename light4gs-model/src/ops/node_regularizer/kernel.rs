//! The regularizer of control nodes: their parameters, the loss, gradients.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

/// How much less rotations count than translations: a quaternion's component is larger than a share of the extent.
pub(crate) const ROTATIONS: f32 = 0.1;
/// Neighbors count by their distance at rest, in a bell curve of this variance, in squares of a radius.
pub(crate) const VARIANCE: f32 = 2.0;

/// The parameters of the nodes that the loss depends on, in the shapes of
/// [`NodeTensors`](super::node_poses::NodeTensors).
#[derive(ExtensionType)]
pub struct RegularizedTensors<B: Backend> {
    /// `[B, 3]`.
    pub anchors: FloatTensor<B>,
    /// `[K, 3 B]`.
    pub translations: FloatTensor<B>,
    /// `[K, 4 B]`.
    pub rotations: FloatTensor<B>,
    /// `[B, 1]`; weights of neighbors only, which get no gradient.
    pub log_radii: FloatTensor<B>,
}

/// Tensors of [`RegularizedTensors`], and those of them that get a gradient: all but the last.
pub(crate) const INPUTS: usize = 4;
pub(crate) const LEARNED: usize = 3;

impl<B: Backend> RegularizedTensors<B> {
    pub(crate) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.anchors, self.translations, self.rotations, self.log_radii]
    }

    pub(crate) fn from_array([anchors, translations, rotations, log_radii]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { anchors, translations, rotations, log_radii }
    }
}

/// Weights of the terms, and the time at which nodes are looked at.
#[derive(Clone, Copy, Debug)]
pub struct Regularization {
    /// Of how far nodes are from where their neighbors see them.
    pub rigidity: f32,
    /// Of the bend of their trajectories.
    pub smoothness: f32,
    /// In [0, 1].
    pub time: f32,
}

/// A back end's kernels. [`NodeRegularizerOps`](crate::ops::node_regularizer::NodeRegularizerOps) adds the dispatch and the tape.
pub trait NodeRegularizerKernels: Backend {
    /// Gradients for a loss that counts once.
    type Derivatives: Clone + Debug + Send + 'static;

    /// The loss `[1]`. Its gradients are worked out along with it: they need all that it needs.
    fn node_regularizer_forward(
        nodes: RegularizedTensors<Self>,
        regularization: Regularization,
    ) -> (FloatTensor<Self>, Self::Derivatives);

    /// Gradients of all parameters but the radii, in their order, from that of the loss `[1]`.
    fn node_regularizer_backward(
        derivatives: Self::Derivatives,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; LEARNED];
}
