//! The hexplane query as a Burn operation: six bilinear samples and their product, one scale at a time.

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
use crate::cpu::hexplane::{PackedPlanes, query, query_backward};
use crate::kernels::hexplane_query::INPUTS;
pub use crate::kernels::hexplane_query::{HexPlaneKernels, QueryGradients, QueryInputs};

/// The query on every back end that has [`HexPlaneKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait HexPlaneOps: Backend {
    /// Features `[N, C]`: the product over the six planes of their bilinear samples (align-corners, border clamp).
    fn hexplane_query(#[extension_type] inputs: QueryInputs<Self>) -> FloatTensor<Self>;
}

for_all_back_ends! {
    HexPlaneOps with HexPlaneKernels {
        fn hexplane_query(inputs: QueryInputs<Self>) -> FloatTensor<Self> {
            Self::query_forward(inputs).0
        }
    }
}

impl<B: HexPlaneOps + HexPlaneKernels, C: CheckpointStrategy> HexPlaneOps for Autodiff<B, C> {
    fn hexplane_query(inputs: QueryInputs<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Query;

        impl<B: HexPlaneKernels> Backward<B, INPUTS> for Query {
            type State = B::Saved;

            fn backward(self, ops: Ops<Self::State, INPUTS>, grads: &mut Gradients, _: &mut Checkpointer) {
                let gradient = grads.consume::<B>(&ops.node);
                let [points, planes @ ..] = ops.parents;
                let gradients = B::query_backward(ops.state, gradient, points.is_some());
                if let (Some(node), Some(gradient)) = (points, gradients.points) {
                    grads.register::<B>(node.id, gradient);
                }
                for (parent, gradient) in planes.into_iter().zip(gradients.planes) {
                    if let Some(node) = parent {
                        grads.register::<B>(node.id, gradient);
                    }
                }
            }
        }

        let inputs = inputs.into_array();
        let nodes = inputs.each_ref().map(|input| input.node());
        let inner = QueryInputs::from_array(inputs.map(|input| input.into_primitive()));
        let (features, saved) = B::query_forward(inner);
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
    shapes: [[usize; 3]; 6],
}

fn forward_on_cpu<B: HostBackend>(inputs: QueryInputs<B>) -> (FloatTensor<B>, CpuSaved) {
    let [points, planes @ ..] = inputs.into_array();
    let shapes = planes.each_ref().map(|plane| plane.shape().dims::<3>());
    let [channels, res_y, res_x] = shapes[0];
    let [_, res_t, res_z] = shapes[5];
    let points = B::to_host(points);
    let planes = planes.map(B::to_host);
    let packed = PackedPlanes::new(planes.each_ref().map(|p| p.as_slice()), channels, [res_x, res_y, res_z, res_t]);
    let features = query(points.as_slice(), &packed);
    let count = points.as_slice().len() / 4;
    (B::from_values(features, [count, channels]), CpuSaved { points, planes: Arc::new(packed), shapes })
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradient: FloatTensor<B>, with_points: bool) -> QueryGradients<B> {
    let upstream = B::to_host(gradient);
    let points = saved.points.as_slice();
    let gradients = query_backward(points, &saved.planes, upstream.as_slice(), with_points);
    let mut shapes = saved.shapes.into_iter();
    QueryGradients {
        points: gradients.points.map(|values| B::from_values(values, [points.len() / 4, 4])),
        planes: gradients.planes.map(|values| B::from_values(values, shapes.next().expect("six shapes"))),
    }
}

for_cpu_back_ends! {
    HexPlaneKernels {
        type Saved = CpuSaved;

        fn query_forward(inputs: QueryInputs<Self>) -> (FloatTensor<Self>, CpuSaved) {
            forward_on_cpu(inputs)
        }

        fn query_backward(saved: CpuSaved, gradient: FloatTensor<Self>, with_points: bool) -> QueryGradients<Self> {
            backward_on_cpu(saved, gradient, with_points)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + HexPlaneKernels> HexPlaneKernels for Fusion<B> {
    type Saved = B::Saved;

    fn query_forward(inputs: QueryInputs<Self>) -> (FloatTensor<Self>, B::Saved) {
        let inputs = QueryInputs::from_array(inputs.into_array().map(resolve::<B>));
        let (features, saved) = B::query_forward(inputs);
        (leaf::<B>(features), saved)
    }

    fn query_backward(saved: B::Saved, gradient: FloatTensor<Self>, with_points: bool) -> QueryGradients<Self> {
        let QueryGradients { points, planes } = B::query_backward(saved, resolve::<B>(gradient), with_points);
        QueryGradients { points: points.map(leaf::<B>), planes: planes.map(leaf::<B>) }
    }
}
