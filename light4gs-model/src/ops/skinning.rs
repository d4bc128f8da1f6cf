//! Linear blend skinning of Gaussians by control nodes (Lewis et al. 2000; for Gaussians SC-GS, Huang et al. 2024), as a Burn
//! operation.

use std::ops::Range;
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
use super::host::{HostBackend, HostTensor};
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
use crate::cpu::skinning::{BlendedGroup, SkinningSlices, skin as skin_slices};
use crate::cpu::skinning_backward::skin_backward;
use crate::kernels::skinning::{INPUTS, MOVED, POSED};
pub use crate::kernels::skinning::{MOST_AFFINITIES, SkinningKernels, SkinningTensors};

/// Skinning on every back end that has [`SkinningKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait SkinningOps: Backend {
    /// Positions and quaternions `[N, 7]`; see [`skin`].
    fn skinning(#[extension_type] tensors: SkinningTensors<Self>) -> FloatTensor<Self>;
}

for_all_back_ends! {
    SkinningOps with SkinningKernels {
        fn skinning(tensors: SkinningTensors<Self>) -> FloatTensor<Self> {
            Self::skinning_forward(tensors).0
        }
    }
}

impl<B: SkinningOps + SkinningKernels, C: CheckpointStrategy> SkinningOps for Autodiff<B, C> {
    fn skinning(tensors: SkinningTensors<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Skinning;

        impl<B: SkinningKernels> Backward<B, INPUTS> for Skinning {
            type State = B::Saved;

            fn backward(self, ops: Ops<Self::State, INPUTS>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |state, gradient| {
                    B::skinning_backward(state, gradient).into_array()
                });
            }
        }

        let tensors = tensors.into_array();
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let inner = SkinningTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let (moved, saved) = B::skinning_forward(inner);
        match Skinning.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(saved, moved),
            OpsKind::UnTracked(prep) => prep.finish(moved),
        }
    }
}

/// State of the CPU back ends between forward and backward.
#[derive(Clone, Debug)]
pub struct CpuSaved {
    means: HostTensor,
    quats: HostTensor,
    stillness: Arc<Vec<f32>>,
    nodes: HostTensor,
    affinities: usize,
    blended: Arc<Vec<BlendedGroup>>,
}

impl CpuSaved {
    fn slices(&self) -> SkinningSlices<'_> {
        SkinningSlices {
            means: self.means.as_slice(),
            quats: self.quats.as_slice(),
            stillness: &self.stillness,
            nodes: self.nodes.as_slice(),
            affinities: self.affinities,
        }
    }
}

/// Stillness `[N, 1]` and affinities `[N, H]`, a Gaussian's numbers next to each other.
fn side_by_side(stillness: &[f32], affinities: &[f32], width: usize) -> Vec<f32> {
    let mut rows = Vec::with_capacity(stillness.len() + affinities.len());
    for (i, stillness) in stillness.iter().enumerate() {
        rows.push(*stillness);
        rows.extend_from_slice(&affinities[width * i..width * (i + 1)]);
    }
    rows
}

/// Some columns of a matrix that is `width` wide.
fn columns_of(matrix: &[f32], width: usize, columns: Range<usize>) -> Vec<f32> {
    matrix.chunks_exact(width).flat_map(|row| &row[columns.clone()]).copied().collect()
}

fn forward_on_cpu<B: HostBackend>(tensors: SkinningTensors<B>) -> (FloatTensor<B>, CpuSaved) {
    let affinities = tensors.affinities.shape()[1];
    let [means, quats, stillness, of_gaussians, nodes] = tensors.into_array().map(B::to_host);
    let stillness = side_by_side(stillness.as_slice(), of_gaussians.as_slice(), affinities);
    let mut saved =
        CpuSaved { means, quats, stillness: Arc::new(stillness), nodes, affinities, blended: Arc::default() };
    let (moved, blended) = skin_slices(&saved.slices());
    saved.blended = Arc::new(blended);
    let count = moved.len() / MOVED;
    (B::from_values(moved, [count, MOVED]), saved)
}

fn backward_on_cpu<B: HostBackend>(saved: CpuSaved, gradient: FloatTensor<B>) -> SkinningTensors<B> {
    let upstream = B::to_host(gradient);
    let affinities = saved.affinities;
    let gradients = skin_backward(&saved.slices(), &saved.blended, upstream.as_slice());
    let count = gradients.means.len() / 3;
    let part = |columns: Range<usize>| {
        let shape = [count, columns.len()];
        B::from_values(columns_of(&gradients.stillness, 1 + affinities, columns), shape)
    };
    let columns = POSED + affinities;
    SkinningTensors {
        stillness: part(0..1),
        affinities: part(1..1 + affinities),
        means: B::from_values(gradients.means, [count, 3]),
        quats: B::from_values(gradients.quats, [count, 4]),
        nodes: B::from_values(gradients.nodes, [saved.nodes.as_slice().len() / columns, columns]),
    }
}

for_cpu_back_ends! {
    SkinningKernels {
        type Saved = CpuSaved;

        fn skinning_forward(tensors: SkinningTensors<Self>) -> (FloatTensor<Self>, CpuSaved) {
            forward_on_cpu(tensors)
        }

        fn skinning_backward(saved: CpuSaved, gradient: FloatTensor<Self>) -> SkinningTensors<Self> {
            backward_on_cpu(saved, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + SkinningKernels> SkinningKernels for Fusion<B> {
    type Saved = B::Saved;

    fn skinning_forward(tensors: SkinningTensors<Self>) -> (FloatTensor<Self>, B::Saved) {
        let tensors = SkinningTensors::from_array(tensors.into_array().map(resolve::<B>));
        let (moved, saved) = B::skinning_forward(tensors);
        (leaf::<B>(moved), saved)
    }

    fn skinning_backward(saved: B::Saved, gradient: FloatTensor<Self>) -> SkinningTensors<Self> {
        let gradients = B::skinning_backward(saved, resolve::<B>(gradient)).into_array();
        SkinningTensors::from_array(gradients.map(leaf::<B>))
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
    /// `1 / (2 r²)` of its radius r; what it does to the space around it: a matrix R row by row (9) and an offset t (3), so that x
    /// goes to `R x + t`, and R's quaternion (w, x, y, z); its own affinities.
    pub nodes: Tensor<2>,
}

/// Linear blend skinning of N Gaussians by B nodes and one that stands still (Lewis et al. 2000; for Gaussians SC-GS, Huang et al.
/// 2024). Returns `[N, 7]`: positions (3) and quaternions (4), which are not normalized.
///
/// ```text
/// w   = softmax over b of (affinities · affinities_b - precision_b |mean - anchor_b|², and stillness for the node that stands still)
/// A   = Σ w_b R_b + w_still I,   t = Σ w_b t_b,   q = Σ w_b q_b + w_still (1, 0, 0, 0)
/// position = A mean + t,   quaternion = q ⊗ quat   (Hamilton's product)
/// ```
///
/// A weight of less than 2⁻⁶⁴ of the largest is 0 on the CPU.
///
/// All inputs get gradients. Weights take the means as constants: what moves a Gaussian does not pull it to another node.
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
/// let moved = skin(SkinningInputs {
///     means: rows(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0], 3),
///     quats: rows(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 4),
///     // The first Gaussian goes with the node, the second stands still.
///     stillness: rows(&[-60.0, 60.0], 1),
///     affinities: None,
///     nodes: rows(&[
///         0.0, 0.0, 0.0, 1.0,
///         0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, half, 0.0, 0.0, half,
///     ], 20),
/// });
/// let moved = moved.into_data().to_vec::<f32>().unwrap();
/// assert_eq!(moved[..7], [0.0, 1.0, 2.0, half, 0.0, 0.0, half]);
/// assert_eq!(moved[7..], [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
/// ```
///
/// # Panics
/// If the shapes do not belong together, or there is no node; the message names the tensor.
pub fn skin(inputs: SkinningInputs) -> Tensor<2> {
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
    Tensor::from_dispatch(Dispatch::skinning(SkinningTensors {
        means: means.into_dispatch(),
        quats: quats.into_dispatch(),
        stillness: stillness.into_dispatch(),
        affinities: affinities.into_dispatch(),
        nodes: nodes.into_dispatch(),
    }))
}
