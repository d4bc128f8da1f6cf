//! The regularizer of control nodes, as a Burn operation: it keeps their motion plausible where no view shows it.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::node_poses::NodeParameters;
use super::{for_all_back_ends, recorded};

/// Weight of rotations relative to translations: a quaternion's component is larger than a share of the extent.
const ROTATIONS: f32 = 0.1;
/// Neighbors count by their distance at rest, in a bell curve of this variance, in squares of a radius.
const VARIANCE: f32 = 2.0;

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
const INPUTS: usize = 4;
const LEARNED: usize = 3;

impl<B: Backend> RegularizedTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.anchors, self.translations, self.rotations, self.log_radii]
    }

    fn from_array([anchors, translations, rotations, log_radii]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { anchors, translations, rotations, log_radii }
    }
}

/// Weights of the terms, and the time of the poses.
#[derive(Clone, Copy, Debug)]
pub struct Regularization {
    /// Weight of the distances of nodes from the places where their neighbors expect them.
    pub rigidity: f32,
    /// Weight of the bend of their trajectories.
    pub smoothness: f32,
    /// In [0, 1].
    pub time: f32,
}

/// A back end's kernels. [`NodeRegularizerOps`] adds the dispatch and the tape.
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

/// The loss on every back end that has [`NodeRegularizerKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NodeRegularizerOps: Backend {
    /// The loss `[1]`; see [`regularize`].
    fn node_regularizer(
        #[extension_type] nodes: RegularizedTensors<Self>,
        regularization: Regularization,
    ) -> FloatTensor<Self>;
}

for_all_back_ends! {
    NodeRegularizerOps with NodeRegularizerKernels {
        fn node_regularizer(nodes: RegularizedTensors<Self>, regularization: Regularization) -> FloatTensor<Self> {
            Self::node_regularizer_forward(nodes, regularization).0
        }
    }
}

impl<B: NodeRegularizerOps + NodeRegularizerKernels, C: CheckpointStrategy> NodeRegularizerOps for Autodiff<B, C> {
    fn node_regularizer(nodes: RegularizedTensors<Self>, regularization: Regularization) -> FloatTensor<Self> {
        let tensors = nodes.into_array();
        let parents = std::array::from_fn(|k| tensors[k].node());
        let inner = RegularizedTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let forward = B::node_regularizer_forward(inner, regularization);
        recorded::<B, C, _, _>(parents, forward, B::node_regularizer_backward)
    }
}

/// The loss `[1]` of control nodes: the distances of nodes from the places where their neighbors expect them (as rigid as
/// possible, Sorkine and Alexa, SGP 2007), and the bend of their trajectories.
///
/// ```text
/// rigidity · Σ w_ij |(p_j - p_i) - R_i (a_j - a_i)|² / Σ w_ij,   w_ij = exp(-|a_j - a_i|² / (4 r_i²))
/// + smoothness · (mean squared second difference of the translations' knots + 0.1 · that of the rotations')
/// ```
///
/// `a` are anchors and `r` radii, `p` places and `R` rotations at the time. Weights take anchors and radii as constants. Affinities and
/// the unit play no part.
///
/// # Panics
/// If the shapes do not belong together, or there is no node; the message names the tensor.
pub fn regularize(nodes: NodeParameters, regularization: Regularization) -> Tensor<1> {
    nodes.check();
    let NodeParameters { anchors, log_radii, translations, rotations, .. } = nodes;
    Tensor::from_dispatch(Dispatch::node_regularizer(
        RegularizedTensors {
            anchors: anchors.into_dispatch(),
            translations: translations.into_dispatch(),
            rotations: rotations.into_dispatch(),
            log_radii: log_radii.into_dispatch(),
        },
        regularization,
    ))
}
