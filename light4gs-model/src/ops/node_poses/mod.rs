//! Poses of control nodes on splines over time, as a Burn operation.

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
use super::host::{HostBackend, HostTensor};
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
use crate::cpu::node_motion::Knots;
use crate::cpu::node_poses::{NodeSlices, pose as pose_slices, pose_backward};
use crate::kernels::node_poses::{INPUTS, LEARNED};
pub use crate::kernels::node_poses::{NodePoseKernels, NodeTensors, Posing};
use crate::kernels::skinning::POSED;

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
        #[derive(Debug)]
        struct NodePoses;

        impl<B: NodePoseKernels> Backward<B, LEARNED> for NodePoses {
            type State = B::Posed;

            fn backward(self, ops: Ops<Self::State, LEARNED>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, B::node_poses_backward);
            }
        }

        let tensors = nodes.into_array();
        let parents = std::array::from_fn(|k| tensors[k].node());
        let inner = NodeTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let (posed, saved) = B::node_poses_forward(inner, posing);
        match NodePoses.prepare::<C>(parents).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(saved, posed),
            OpsKind::UnTracked(prep) => prep.finish(posed),
        }
    }
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    inputs: [HostTensor; INPUTS],
    nodes: usize,
    posing: Posing,
}

impl CpuSaved {
    fn slices(&self) -> NodeSlices<'_> {
        let [anchors, log_radii, translations, rotations, affinities, unit] =
            self.inputs.each_ref().map(HostTensor::as_slice);
        let affinities = if self.posing.affinities > 0 { affinities } else { &[] };
        let knots = Knots { translations, rotations, nodes: self.nodes };
        NodeSlices { anchors, log_radii, knots, affinities, unit: unit[0] }
    }
}

fn forward_on_cpu<B: HostBackend>(nodes: NodeTensors<B>, posing: Posing) -> (FloatTensor<B>, CpuSaved) {
    let count = nodes.anchors.shape()[0];
    let saved = CpuSaved { inputs: nodes.into_array().map(B::to_host), nodes: count, posing };
    let posed = pose_slices(&saved.slices(), posing.time);
    (B::from_values(posed, [count, POSED + posing.affinities]), saved)
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradient: FloatTensor<B>) -> [FloatTensor<B>; LEARNED] {
    let upstream = B::to_host(gradient);
    let slices = saved.slices();
    let (nodes, knots) = (saved.nodes, slices.knots.count());
    let gradients = pose_backward(&slices, saved.posing.time, upstream.as_slice());
    [
        B::from_values(gradients.anchors, [nodes, 3]),
        B::from_values(gradients.log_radii, [nodes, 1]),
        B::from_values(gradients.translations, [knots, 3 * nodes]),
        B::from_values(gradients.rotations, [knots, 4 * nodes]),
        B::from_values(gradients.affinities, [nodes, saved.posing.affinities]),
    ]
}

for_cpu_back_ends! {
    NodePoseKernels {
        type Posed = CpuSaved;

        fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (FloatTensor<Self>, CpuSaved) {
            forward_on_cpu(nodes, posing)
        }

        fn node_poses_backward(saved: CpuSaved, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; LEARNED] {
            backward_on_cpu::<Self>(saved, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + NodePoseKernels> NodePoseKernels for Fusion<B> {
    type Posed = B::Posed;

    fn node_poses_forward(nodes: NodeTensors<Self>, posing: Posing) -> (FloatTensor<Self>, B::Posed) {
        let nodes = NodeTensors::from_array(nodes.into_array().map(resolve::<B>));
        let (posed, saved) = B::node_poses_forward(nodes, posing);
        (leaf::<B>(posed), saved)
    }

    fn node_poses_backward(saved: B::Posed, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; LEARNED] {
        B::node_poses_backward(saved, resolve::<B>(gradient)).map(leaf::<B>)
    }
}

/// The parameters of B control nodes. Lengths are shares of the unit.
#[derive(Clone, Debug)]
pub struct NodeParameters {
    /// `[B, 3]`: where the nodes are at rest.
    pub anchors: Tensor<2>,
    /// `[B, 1]`: logarithms of how far they reach.
    pub log_radii: Tensor<2>,
    /// `[K, 3 B]`: knots of how far they are moved, the three numbers of a node behind each other; K is 4 or more.
    pub translations: Tensor<2>,
    /// `[K, 4 B]`: knots of how they are turned, the four numbers of a node behind each other: quaternions (w, x, y, z), of any
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
