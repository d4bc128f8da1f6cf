//! What keeps the motion of control nodes plausible where no view says how it is, as a Burn operation.

use std::sync::Arc;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};

#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::host::HostBackend;
use super::node_poses::NodeParameters;
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
use crate::cpu::node_motion::Knots;
use crate::cpu::node_regularizer::{Regularized, regularize as regularize_slices};
use crate::kernels::node_regularizer::LEARNED;
pub use crate::kernels::node_regularizer::{NodeRegularizerKernels, Regularization, RegularizedTensors};

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
        #[derive(Debug)]
        struct NodeRegularizer;

        impl<B: NodeRegularizerKernels> Backward<B, LEARNED> for NodeRegularizer {
            type State = B::Derivatives;

            fn backward(self, ops: Ops<Self::State, LEARNED>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, B::node_regularizer_backward);
            }
        }

        let tensors = nodes.into_array();
        let parents = std::array::from_fn(|k| tensors[k].node());
        let inner = RegularizedTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let (loss, derivatives) = B::node_regularizer_forward(inner, regularization);
        match NodeRegularizer.prepare::<C>(parents).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(derivatives, loss),
            OpsKind::UnTracked(prep) => prep.finish(loss),
        }
    }
}

fn forward_on_cpu<B: HostBackend>(
    nodes: RegularizedTensors<B>,
    regularization: &Regularization,
) -> (FloatTensor<B>, Arc<Regularized>) {
    let count = nodes.anchors.shape()[0];
    let inputs = nodes.into_array().map(B::to_host);
    let [anchors, translations, rotations, log_radii] = inputs.each_ref().map(|input| input.as_slice());
    let knots = Knots { translations, rotations, nodes: count };
    let regularized = regularize_slices(anchors, log_radii, knots, regularization);
    (B::from_values(vec![regularized.loss], [1]), Arc::new(regularized))
}

fn backward_on_cpu<B: HostBackend>(regularized: &Regularized, gradient: FloatTensor<B>) -> [FloatTensor<B>; LEARNED] {
    let scale = B::to_host(gradient).as_slice()[0];
    let scaled = |values: &[f32], rows: usize| {
        let columns = values.len() / rows;
        B::from_values(values.iter().map(|value| scale * value).collect(), [rows, columns])
    };
    let nodes = regularized.anchors.len() / 3;
    let knots = regularized.translations.len() / (3 * nodes);
    let Regularized { anchors, translations, rotations, .. } = regularized;
    [scaled(anchors, nodes), scaled(translations, knots), scaled(rotations, knots)]
}

for_cpu_back_ends! {
    NodeRegularizerKernels {
        type Derivatives = Arc<Regularized>;

        fn node_regularizer_forward(
            nodes: RegularizedTensors<Self>,
            regularization: Regularization,
        ) -> (FloatTensor<Self>, Arc<Regularized>) {
            forward_on_cpu(nodes, &regularization)
        }

        fn node_regularizer_backward(
            derivatives: Arc<Regularized>,
            gradient: FloatTensor<Self>,
        ) -> [FloatTensor<Self>; LEARNED] {
            backward_on_cpu::<Self>(&derivatives, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + NodeRegularizerKernels> NodeRegularizerKernels for Fusion<B> {
    type Derivatives = B::Derivatives;

    fn node_regularizer_forward(
        nodes: RegularizedTensors<Self>,
        regularization: Regularization,
    ) -> (FloatTensor<Self>, B::Derivatives) {
        let nodes = RegularizedTensors::from_array(nodes.into_array().map(resolve::<B>));
        let (loss, derivatives) = B::node_regularizer_forward(nodes, regularization);
        (leaf::<B>(loss), derivatives)
    }

    fn node_regularizer_backward(
        derivatives: B::Derivatives,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; LEARNED] {
        B::node_regularizer_backward(derivatives, resolve::<B>(gradient)).map(leaf::<B>)
    }
}

/// The loss `[1]` of control nodes: how far nodes are from where their neighbors see them (as rigid as possible, Sorkine and Alexa,
/// SGP 2007), and how much their trajectories bend.
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
