//! What keeps motion plausible where no view says how it is.

use burn::tensor::{Tensor, s};

use super::NodesField;
use super::trajectory::rotation_matrices;

/// How much less rotations count than translations: a quaternion's component is larger than a share of the extent.
const ROTATIONS: f32 = 0.1;

impl NodesField {
    /// `[1]`: mean squared second differences of the trajectories' knots.
    pub(super) fn roughness(&self) -> Tensor<1> {
        let last = self.knots();
        let bend = |knots: Tensor<2>| {
            let part = |first: usize, end: usize| knots.clone().slice(s![first..end, ..]);
            (part(0, last - 2) - part(1, last - 1) * 2.0 + part(2, last)).powi_scalar(2).mean()
        };
        bend(self.translations.val()) + bend(self.rotations.val()) * ROTATIONS
    }

    /// `[1]`: how far nodes are at a time from where their neighbors see them, squared, in the mean over neighbors
    /// (as rigid as possible, Sorkine and Alexa, SGP 2007). Neighbors count by their distance before anything moves.
    pub(super) fn strain(&self, time: f32) -> Tensor<1> {
        let nodes = self.nodes();
        let (translations, quats) = self.motion(time);
        let anchors = self.anchors.val();
        let to_others = |places: Tensor<2>| places.clone().reshape([1, nodes, 3]) - places.reshape([nodes, 1, 3]);
        let before = to_others(anchors.clone());
        let now = to_others(anchors + translations);
        let squares = before.clone().detach().powi_scalar(2).sum_dim(2).reshape([nodes, nodes]);
        let precisions = (self.log_radii.val().detach() * -2.0).exp() * -0.25;
        let weights = (squares * precisions).exp();
        let turned = before.matmul(rotation_matrices(&quats).reshape([nodes, 3, 3]).swap_dims(1, 2));
        let strain = (now - turned).powi_scalar(2).sum_dim(2).reshape([nodes, nodes]);
        (strain * weights.clone()).sum() / weights.sum()
    }
}
