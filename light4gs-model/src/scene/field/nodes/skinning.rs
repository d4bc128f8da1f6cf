//! Linear blend skinning: every Gaussian follows the nodes around it.

use burn::tensor::activation::softmax;
use burn::tensor::{Tensor, s};

use super::STILLNESS;
use super::trajectory::columns;
use crate::scene::GaussianTensors;

/// What skinning needs of the nodes.
pub(super) struct NodesAtTime {
    /// `[B, 3]`, world units, before anything moves.
    pub anchors: Tensor<2>,
    /// `[B, 1]`: 1 / (2 r²).
    pub precisions: Tensor<2>,
    /// `[B, 16]`: rotation matrix row by row, offset, quaternion.
    pub poses: Tensor<2>,
}

/// The matrix of a product from the left with a quaternion: its components, 4 to 7 negative.
pub(super) const PRODUCT: [usize; 16] = [0, 5, 6, 7, 1, 0, 7, 2, 2, 3, 0, 5, 3, 6, 1, 0];
/// A pose that moves nothing.
pub(super) const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// The Gaussians, moved. Weights take positions as constants: a Gaussian does not move only to follow another node.
pub(super) fn skin(canonical: GaussianTensors, nodes: NodesAtTime) -> GaussianTensors {
    let ([count, _], [bodies, _]) = (canonical.means.dims(), nodes.anchors.dims());
    let offsets = canonical.means.clone().detach().unsqueeze_dim::<3>(1) - nodes.anchors.unsqueeze_dim::<3>(0);
    let squares = offsets.powi_scalar(2).sum_dim(2).reshape([count, bodies]);
    let mut logits = squares * nodes.precisions.transpose() * -1.0;
    let mut poses = nodes.poses;
    if let Some(stillness) = canonical.further(STILLNESS) {
        logits = Tensor::cat(vec![logits, stillness.clone()], 1);
        poses = Tensor::cat(vec![poses.clone(), Tensor::from_floats([IDENTITY], &poses.device())], 0);
    }
    let blended = softmax(logits, 1).matmul(poses);
    let moved = products(blended.clone().slice(s![.., 0..9]), &canonical.means);
    let means = moved + blended.clone().slice(s![.., 9..12]);
    let turn = blended.slice(s![.., 12..16]);
    let product = columns(&Tensor::cat(vec![turn.clone(), -turn], 1), &PRODUCT);
    // Quaternions may have any length.
    GaussianTensors { means, quats: products(product, &canonical.quats), ..canonical }
}

/// Each row of `matrices [N, n n]` times the row of `vectors [N, n]`.
fn products(matrices: Tensor<2>, vectors: &Tensor<2>) -> Tensor<2> {
    let [count, n] = vectors.dims();
    (matrices.reshape([count, n, n]) * vectors.clone().reshape([count, 1, n])).sum_dim(2).reshape([count, n])
}
