//! The query of feature planes as a Burn operation: bilinear samples and their product, one scale at a time.

use std::sync::Arc;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, TensorMetadata, backend_extension};
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};

#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::host::{HostBackend, HostTensor};
use super::{for_all_back_ends, for_cpu_back_ends};
use crate::cpu::planes::{PackedPlanes, query, query_backward};
use crate::kernels::plane_query::{INPUTS, PLANES};
pub use crate::kernels::plane_query::{PlaneQueryGradients, PlaneQueryInputs, PlaneQueryKernels, PlaneSet};

/// The query on every back end that has [`PlaneQueryKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait PlaneQueryOps: Backend {
    /// Features `[N, C]`: the product over the planes of their bilinear samples (align-corners, border clamp).
    fn plane_query(#[extension_type] inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> FloatTensor<Self>;
}

for_all_back_ends! {
    PlaneQueryOps with PlaneQueryKernels {
        fn plane_query(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> FloatTensor<Self> {
            Self::query_forward(inputs, planes).0
        }
    }
}

impl<B: PlaneQueryOps + PlaneQueryKernels, C: CheckpointStrategy> PlaneQueryOps for Autodiff<B, C> {
    fn plane_query(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Query;

        impl<B: PlaneQueryKernels> Backward<B, INPUTS> for Query {
            type State = B::Saved;

            fn backward(self, ops: Ops<Self::State, INPUTS>, grads: &mut Gradients, _: &mut Checkpointer) {
                let gradient = grads.consume::<B>(&ops.node);
                let [points, planes @ ..] = ops.parents;
                let gradients = B::query_backward(ops.state, gradient, points.is_some());
                if let (Some(node), Some(gradient)) = (points, gradients.points) {
                    grads.register::<B>(node.id, gradient);
                }
                for (parent, gradient) in planes.into_iter().zip(gradients.planes) {
                    if let (Some(node), Some(gradient)) = (parent, gradient) {
                        grads.register::<B>(node.id, gradient);
                    }
                }
            }
        }

        let inputs = inputs.into_array();
        let nodes = inputs.each_ref().map(|input| input.node());
        let inner = PlaneQueryInputs::from_array(inputs.map(|input| input.into_primitive()));
        let (features, saved) = B::query_forward(inner, planes);
        match Query.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(saved, features),
            OpsKind::UnTracked(prep) => prep.finish(features),
        }
    }
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    points: HostTensor,
    planes: Arc<PackedPlanes>,
    /// `None` where there is no plane.
    shapes: [Option<[usize; 3]>; PLANES],
}

fn forward_on_cpu<B: HostBackend>(inputs: PlaneQueryInputs<B>, set: PlaneSet) -> (FloatTensor<B>, CpuSaved) {
    let [points, planes @ ..] = inputs.into_array();
    let mut present = set.0.into_iter();
    let planes = planes.map(|plane| present.next().expect("one a plane").then_some(plane));
    let shapes = planes.each_ref().map(|plane| plane.as_ref().map(|plane| plane.shape().dims::<3>()));
    let points = B::to_host(points);
    let planes = planes.map(|plane| plane.map(B::to_host));
    let packed = PackedPlanes::new(planes.each_ref().map(|plane| plane.as_ref().map(HostTensor::as_slice)), &shapes);
    let features = query(points.as_slice(), &packed);
    let count = points.as_slice().len() / 4;
    let channels = packed.channels();
    (B::from_values(features, [count, channels]), CpuSaved { points, planes: Arc::new(packed), shapes })
}

fn backward_on_cpu<B: HostBackend>(
    saved: CpuSaved,
    gradient: FloatTensor<B>,
    with_points: bool,
) -> PlaneQueryGradients<B> {
    let upstream = B::to_host(gradient);
    let points = saved.points.as_slice();
    let gradients = query_backward(points, &saved.planes, upstream.as_slice(), with_points);
    let mut shapes = saved.shapes.into_iter();
    PlaneQueryGradients {
        points: gradients.points.map(|values| B::from_values(values, [points.len() / 4, 4])),
        planes: gradients.planes.map(|values| Some(B::from_values(values, shapes.next()??))),
    }
}

for_cpu_back_ends! {
    PlaneQueryKernels {
        type Saved = CpuSaved;

        fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (FloatTensor<Self>, CpuSaved) {
            forward_on_cpu(inputs, planes)
        }

        fn query_backward(saved: CpuSaved, gradient: FloatTensor<Self>, with_points: bool) -> PlaneQueryGradients<Self> {
            backward_on_cpu(saved, gradient, with_points)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + PlaneQueryKernels> PlaneQueryKernels for Fusion<B> {
    type Saved = B::Saved;

    fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (FloatTensor<Self>, B::Saved) {
        let inputs = PlaneQueryInputs::from_array(inputs.into_array().map(resolve::<B>));
        let (features, saved) = B::query_forward(inputs, planes);
        (leaf::<B>(features), saved)
    }

    fn query_backward(saved: B::Saved, gradient: FloatTensor<Self>, with_points: bool) -> PlaneQueryGradients<Self> {
        let PlaneQueryGradients { points, planes } = B::query_backward(saved, resolve::<B>(gradient), with_points);
        PlaneQueryGradients { points: points.map(leaf::<B>), planes: planes.map(|plane| plane.map(leaf::<B>)) }
    }
}
