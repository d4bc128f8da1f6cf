//! Linear blend skinning of Gaussians by control nodes (Lewis et al. 2000; for Gaussians SC-GS, Huang et al. 2024), as a Burn
//! operation.

mod cpu;
mod cpu_backward;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::tensor::{Shape, Tensor};

use super::{for_all_back_ends, recorded_outputs};

/// Numbers of a node's pose: rotation matrix row by row (9), offset (3), quaternion (4).
const POSE: usize = 16;
/// Where a node's pose begins, behind its anchor (3) and precision (1).
pub(crate) const PLACE: usize = 4;
/// Numbers of a posed node before its affinities.
pub(crate) const POSED: usize = PLACE + POSE;
/// Numbers of a moved Gaussian: position, quaternion.
const MOVED: [usize; 2] = [3, 4];

/// Most affinities of a Gaussian and of a node.
pub const MOST_AFFINITIES: usize = 4;

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
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
const INPUTS: usize = 5;

impl<B: Backend> SkinningTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.means, self.quats, self.stillness, self.affinities, self.nodes]
    }

    fn from_array(tensors: [FloatTensor<B>; INPUTS]) -> Self {
        let [means, quats, stillness, affinities, nodes] = tensors;
        Self { means, quats, stillness, affinities, nodes }
    }
}

/// The moved Gaussians, or their gradients.
#[derive(Clone, Debug, ExtensionType)]
pub struct MovedTensors<B: Backend> {
    /// `[N, 3]`, world units.
    pub means: FloatTensor<B>,
    /// `[N, 4]`: quaternions (w, x, y, z).
    pub quats: FloatTensor<B>,
}

/// A back end's kernels. [`SkinningOps`] adds the dispatch and the tape.
pub trait SkinningKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Saved: Clone + Debug + Send + 'static;

    /// Positions and quaternions.
    fn skinning_forward(tensors: SkinningTensors<Self>) -> (MovedTensors<Self>, Self::Saved);

    /// Gradients of all inputs from those of positions and quaternions.
    fn skinning_backward(saved: Self::Saved, gradients: MovedTensors<Self>) -> SkinningTensors<Self>;
}

/// Skinning on every back end that has [`SkinningKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait SkinningOps: Backend {
    /// Positions and quaternions; see [`skin`].
    fn skinning(#[extension_type] tensors: SkinningTensors<Self>) -> MovedTensors<Self>;
}

for_all_back_ends! {
    SkinningOps with SkinningKernels {
        fn skinning(tensors: SkinningTensors<Self>) -> MovedTensors<Self> {
            Self::skinning_forward(tensors).0
        }
    }
}

impl<B: SkinningOps + SkinningKernels, C: CheckpointStrategy> SkinningOps for Autodiff<B, C> {
    fn skinning(tensors: SkinningTensors<Self>) -> MovedTensors<Self> {
        let tensors = tensors.into_array();
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let inner = SkinningTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let (MovedTensors { means, quats }, saved) = B::skinning_forward(inner);
        let (count, device, dtype) = (means.shape()[0], means.device(), means.dtype());
        let saved = (saved, count, device, dtype);
        let moved = recorded_outputs::<B, C, _, _, _>(
            nodes,
            ([means, quats], saved),
            |(saved, count, device, dtype), [means, quats]| {
                let or_zeros = |gradient: Option<FloatTensor<B>>, columns: usize| {
                    gradient.unwrap_or_else(|| B::float_zeros(Shape::from([count, columns]), &device, dtype.into()))
                };
                let gradients = MovedTensors { means: or_zeros(means, MOVED[0]), quats: or_zeros(quats, MOVED[1]) };
                B::skinning_backward(saved, gradients).into_array()
            },
        );
        let [means, quats] = moved;
        MovedTensors { means, quats }
    }
}

/// Gaussians and the nodes that move them, at one time.
#[derive(Clone, Debug)]
pub struct SkinningInputs {
    /// `[N, 3]`: where the Gaussians are at rest, world units.
    pub means: Tensor<2>,
    /// `[N, 4]`: their orientations at rest as quaternions (w, x, y, z), of any length.
    pub quats: Tensor<2>,
    /// `[N, 1]`: logit of the node that stands still.
    pub stillness: Tensor<2>,
    /// `[N, H]`: each Gaussian's affinities, H up to [`MOST_AFFINITIES`].
    pub affinities: Option<Tensor<2>>,
    /// `[B, 20 + H]`, the nodes, such as [`pose`](super::node_poses::pose) gives them: where each is at rest (3), world units;
    /// `1 / (2 r²)` of its radius r (1); the motion of the space around it, `x` to `R x + t`: the matrix R row by row (9), the
    /// offset t (3), R's quaternion (w, x, y, z) (4); its own affinities (H).
    pub nodes: Tensor<2>,
}

impl SkinningInputs {
    /// Gaussians without affinities, and nodes `[B, 20]`.
    pub fn new(means: Tensor<2>, quats: Tensor<2>, stillness: Tensor<2>, nodes: Tensor<2>) -> Self {
        Self { means, quats, stillness, affinities: None, nodes }
    }
}

/// Gaussians that nodes have moved.
#[derive(Clone, Debug)]
pub struct Moved {
    /// `[N, 3]`, world units.
    pub means: Tensor<2>,
    /// `[N, 4]`: quaternions (w, x, y, z), not normalized.
    pub quats: Tensor<2>,
}

/// Linear blend skinning of N Gaussians by B nodes and one that stands still (Lewis et al. 2000; for Gaussians SC-GS, Huang et al.
/// 2024).
///
/// ```text
/// w   = softmax over b of (affinities · affinities_b - precision_b |mean - anchor_b|², and stillness for the node that stands still)
/// A   = Σ w_b R_b + w_still I,   t = Σ w_b t_b,   q = Σ w_b q_b + w_still (1, 0, 0, 0)
/// position = A mean + t,   quaternion = q ⊗ quat   (Hamilton's product)
/// ```
///
/// A weight of less than 2⁻⁶⁴ of the largest is 0 on the CPU.
///
/// All inputs get gradients. Weights take the means as constants: the gradient that moves a Gaussian does not pull it to
/// another node.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::skinning::{SkinningInputs, skin};
///
/// let device = Device::flex();
/// let rows = |values: &[f32], columns: usize| {
///     Tensor::<1>::from_floats(values, &device).reshape([values.len() / columns, columns])
/// };
/// // One node, at the origin, that turns what is near it by a quarter about z and lifts it by 2.
/// let half = 0.5_f32.sqrt();
/// let means = rows(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0], 3);
/// let quats = rows(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 4);
/// // The first Gaussian goes with the node, the second stands still.
/// let stillness = rows(&[-60.0, 60.0], 1);
/// let nodes = rows(&[
///     0.0, 0.0, 0.0, 1.0,
///     0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, half, 0.0, 0.0, half,
/// ], 20);
/// let moved = skin(SkinningInputs::new(means, quats, stillness, nodes));
/// let [means, quats] = [moved.means, moved.quats].map(|tensor| tensor.into_data().to_vec::<f32>().unwrap());
/// assert_eq!(means, [0.0, 1.0, 2.0, 1.0, 0.0, 0.0]);
/// assert_eq!(quats, [half, 0.0, 0.0, half, 1.0, 0.0, 0.0, 0.0]);
/// ```
///
/// # Panics
/// If the shapes do not belong together, or there is no node; the message names the tensor.
pub fn skin(inputs: SkinningInputs) -> Moved {
    let SkinningInputs { means, quats, stillness, affinities, nodes } = inputs;
    let count = means.dims()[0];
    assert!(nodes.dims()[0] > 0, "nodes must have one row or more");
    assert_eq!(means.dims(), [count, 3], "means must be [N, 3]");
    assert_eq!(quats.dims(), [count, 4], "quats must be [N, 4]");
    assert_eq!(stillness.dims(), [count, 1], "stillness must be [N, 1]");
    let affinities = affinities.unwrap_or_else(|| Tensor::empty([count, 0], &means.device()));
    let [rows, columns] = affinities.dims();
    assert!(columns <= MOST_AFFINITIES, "a Gaussian has at most {MOST_AFFINITIES} affinities");
    assert_eq!(rows, count, "affinities must be [N, H]");
    assert_eq!(nodes.dims()[1], POSED + columns, "nodes must be [B, 20 + H]");
    let moved = Dispatch::skinning(SkinningTensors {
        means: means.into_dispatch(),
        quats: quats.into_dispatch(),
        stillness: stillness.into_dispatch(),
        affinities: affinities.into_dispatch(),
        nodes: nodes.into_dispatch(),
    });
    Moved { means: Tensor::from_dispatch(moved.means), quats: Tensor::from_dispatch(moved.quats) }
}
