//! Gaussians, nodes and poses as plain numbers, for steps of training that are rare and consist of decisions more than of
//! arithmetic.

use super::placement::square;
use super::{AFFINITY, NodesField, STILLNESS, numbers};
use crate::ops::activation::sigmoid;
use crate::ops::node_poses::pose;
use crate::ops::skinning::{PLACE, POSED};
use crate::scene::field::SceneAtRest;

/// Smallest weight with which a node counts.
const LEAST_WEIGHT: f32 = 1e-3;

/// Gaussians and nodes at rest as plain numbers, world units.
pub(super) struct Skinned {
    pub(super) means: Vec<[f32; 3]>,
    pub(super) opacities: Vec<f32>,
    stillness: Vec<f32>,
    anchors: Vec<[f32; 3]>,
    precisions: Vec<f32>,
    /// Number of affinities of each Gaussian and of each node; 0 for none.
    affinities: usize,
    of_gaussians: Vec<f32>,
    of_nodes: Vec<f32>,
}

/// The nodes that count for a Gaussian, with their weights.
pub(super) type Weights = Vec<(usize, f32)>;

impl Skinned {
    fn nodes(&self) -> usize {
        self.anchors.len()
    }

    /// The weights of a Gaussian.
    pub(super) fn weights(&self, gaussian: usize) -> Weights {
        let place = &self.means[gaussian];
        let columns = |row: usize| row * self.affinities..(row + 1) * self.affinities;
        let own = &self.of_gaussians[columns(gaussian)];
        let logit = |node: usize| {
            let affinity: f32 = own.iter().zip(&self.of_nodes[columns(node)]).map(|(own, other)| own * other).sum();
            affinity - self.precisions[node] * square(place, &self.anchors[node])
        };
        let logits = (0..self.nodes()).map(logit).chain([self.stillness[gaussian]]);
        let mut weights: Weights = logits.enumerate().collect();
        let largest = weights.iter().map(|(_, logit)| *logit).fold(f32::MIN, f32::max);
        weights.iter_mut().for_each(|(_, weight)| *weight = (*weight - largest).exp());
        let sum: f32 = weights.iter().map(|(_, weight)| weight).sum();
        weights.retain(|(_, weight)| *weight > LEAST_WEIGHT * sum);
        weights.iter_mut().for_each(|(_, weight)| *weight /= sum);
        weights
    }
}

/// Matrices and offsets of all nodes at a time, and behind them those of standing still.
pub(super) struct PosesAt(Vec<[f32; 12]>);

impl PosesAt {
    fn moved(&self, node: usize, point: &[f32; 3]) -> [f32; 3] {
        let pose = &self.0[node];
        std::array::from_fn(|row| {
            let [x, y, z] = point;
            pose[3 * row] * x + pose[3 * row + 1] * y + pose[3 * row + 2] * z + pose[9 + row]
        })
    }

    pub(super) fn blended(&self, weights: &Weights, point: &[f32; 3]) -> [f32; 3] {
        weights.iter().fold([0.0; 3], |sum, (node, weight)| {
            let place = self.moved(*node, point);
            std::array::from_fn(|axis| sum[axis] + weight * place[axis])
        })
    }
}

impl NodesField {
    pub(super) fn poses_at(&self, time: f32) -> PosesAt {
        let posed = numbers(pose(self.parameters(), time));
        let rows = posed.chunks_exact(POSED + self.config.affinities);
        let still = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        PosesAt(rows.map(|row| std::array::from_fn(|at| row[PLACE + at])).chain([still]).collect())
    }

    pub(super) fn plain_numbers(&self, scene: &SceneAtRest<'_>) -> Skinned {
        let tensors = scene.gaussians.tensors();
        let means: Vec<[f32; 3]> = numbers(tensors.means.clone()).as_chunks::<3>().0.to_vec();
        let stillness = match tensors.further(STILLNESS) {
            Some(logits) => numbers(logits.clone()),
            None => vec![super::NEVER_STILL; means.len()],
        };
        let posed = numbers(pose(self.parameters(), 0.0));
        let nodes = posed.chunks_exact(POSED + self.config.affinities);
        Skinned {
            means,
            opacities: numbers(sigmoid(tensors.opacity_logits.clone())),
            stillness,
            anchors: nodes.clone().map(|row| [row[0], row[1], row[2]]).collect(),
            precisions: nodes.map(|row| row[PLACE - 1]).collect(),
            affinities: self.config.affinities,
            of_gaussians: tensors.further(AFFINITY).map(|all| numbers(all.clone())).unwrap_or_default(),
            of_nodes: self.affinities.as_ref().map(|all| numbers(all.val())).unwrap_or_default(),
        }
    }
}
