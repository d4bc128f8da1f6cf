//! The query of feature planes as a Burn operation: bilinear samples and their product, one scale at a time.

mod cpu;
mod cpu_backward;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, ExtensionType, backend_extension};
use light4gs_codec::plane_layout::PlaneAxes;

use super::for_all_back_ends;

/// Which of the planes xy, xz, xt, yz, yt, zt exist; at least one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlaneSet(pub [bool; PLANES]);

impl PlaneSet {
    /// Whether all of them exist.
    pub fn is_full(self) -> bool {
        self.0 == [true; PLANES]
    }
}

/// Points, and the planes of one scale, which have equal sizes along common axes. A placeholder for a plane that does
/// not exist is not read.
#[derive(ExtensionType)]
pub struct PlaneQueryInputs<B: Backend> {
    /// `[N, 4]`: x, y, z, t in [-1, 1]; coordinates outside are clamped to the border.
    pub points: FloatTensor<B>,
    /// `[C, res y, res x]`.
    pub xy: FloatTensor<B>,
    /// `[C, res z, res x]`.
    pub xz: FloatTensor<B>,
    /// `[C, res t, res x]`.
    pub xt: FloatTensor<B>,
    /// `[C, res z, res y]`.
    pub yz: FloatTensor<B>,
    /// `[C, res t, res y]`.
    pub yt: FloatTensor<B>,
    /// `[C, res t, res z]`.
    pub zt: FloatTensor<B>,
}

/// Planes that a scale may have.
const PLANES: usize = PlaneAxes::ALL.len();
/// Tensors of [`PlaneQueryInputs`].
const INPUTS: usize = 1 + PLANES;

impl<B: Backend> PlaneQueryInputs<B> {
    fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.points, self.xy, self.xz, self.xt, self.yz, self.yt, self.zt]
    }

    fn from_array([points, xy, xz, xt, yz, yt, zt]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { points, xy, xz, xt, yz, yt, zt }
    }
}

/// Gradients of a query.
pub struct PlaneQueryGradients<B: Backend> {
    /// `[N, 4]`; `None` if not requested.
    pub points: Option<FloatTensor<B>>,
    /// In the shapes of the planes; `None` where there is no plane.
    pub planes: [Option<FloatTensor<B>>; PLANES],
}

/// A back end's kernels. [`PlaneQueryOps`] adds the dispatch and the tape.
pub trait PlaneQueryKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Saved: Clone + Debug + Send + 'static;

    /// Features `[N, C]`.
    fn query_forward(inputs: PlaneQueryInputs<Self>, planes: PlaneSet) -> (FloatTensor<Self>, Self::Saved);

    /// Gradients of planes and, if `with_points`, of the points.
    fn query_backward(saved: Self::Saved, gradient: FloatTensor<Self>, with_points: bool) -> PlaneQueryGradients<Self>;
}

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
