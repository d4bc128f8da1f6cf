//! The survey: all times are shown before a window of time widens. It finds the ways of objects, though not their rotations.
//!
//! An object that turns fast is found at every time, but its texture is a mean over wrong rotations. Its way is worth
//! keeping: in a window, texture and rotations are learned anew. Knots beyond the window continue the rotation, while the
//! middle of their object stays on the way that was found. Without that way, objects that bounce would be lost, since
//! they do not move on as before.

use burn::module::Param;
use burn::tensor::{Tensor, s};

use super::plain::PosesAt;
use super::trajectory::{knot_at, knots_through, not_damped, rotation_matrices, touched};
use super::{NodesField, tensor};
use crate::scene::field::SceneAtRest;

/// Standard deviation of the difference between the displacements of a node and of a Gaussian of its object, as a share of
/// the extent.
const ALIKE: f32 = 0.04;
/// Smallest weight with which a Gaussian counts.
const LEAST_WEIGHT: f32 = 1e-3;

impl NodesField {
    /// Finds the objects' ways, and gives all knots the rotation of the knot in the middle of a window.
    pub(super) fn survey(&mut self, scene: &SceneAtRest<'_>, [low, high]: [f32; 2]) {
        self.ways = Some(Param::from_tensor(self.ways_of_objects(scene)).set_require_grad(false));
        let knots = self.knots();
        let middle = knot_at(0.5 * (low + high), knots);
        let turns = self.rotations.val().slice(s![middle..middle + 1, ..]).repeat_dim(0, knots);
        self.rotations = Param::initialized(self.rotations.id, turns.detach().require_grad());
        if let Some(translations) = self.translations_on_ways() {
            self.translations = Param::initialized(self.translations.id, translations.detach().require_grad());
        }
    }

    /// The translations `[K, 3 B]` that keep the middles of objects on their ways, for the present rotations. `None` if there
    /// was no survey.
    fn translations_on_ways(&self) -> Option<Tensor<2>> {
        let ways = self.ways.as_ref()?.val();
        let (knots, nodes) = (self.knots(), self.nodes());
        let one = Tensor::from_floats([[1.0, 0.0, 0.0, 0.0]], &self.device());
        let quats = self.rotations.val().reshape([knots * nodes, 4]) + one;
        let quats = quats.clone() / quats.powi_scalar(2).sum_dim(1).sqrt();
        let matrices = rotation_matrices(&quats).reshape([knots, nodes, 3, 3]);
        let anchors = self.anchors.val().reshape([1, 3 * nodes]);
        let arms = ways.clone().slice(s![0..1, ..]) - anchors.clone();
        let turned = (matrices * arms.reshape([1, nodes, 1, 3])).sum_dim(3).reshape([knots, 3 * nodes]);
        Some(ways.slice(s![1.., ..]) - anchors - turned)
    }

    /// The translations `[K, 3 B]`, where knots that a window does not touch follow their object's way, from its place at the
    /// window's end. `None` if there was no survey.
    pub(super) fn translations_beyond(&self, low: f32, high: f32) -> Option<Tensor<2>> {
        let on_ways = self.translations_on_ways()?;
        let translations = self.translations.val();
        let knots = self.knots();
        let (first, last) = touched(knots, low, high);
        let first = if low > 0.0 { first } else { 0 };
        let last = if high < 1.0 { last } else { knots - 1 };
        let off = translations.clone() - on_ways.clone();
        // An offset from the way at the window's end shrinks from knot to knot beyond it.
        let beyond = |knot: usize, end: usize| {
            let row = |tensor: &Tensor<2>, at: usize| tensor.clone().slice(s![at..at + 1, ..]);
            row(&on_ways, knot) + row(&off, end) * not_damped(knot.abs_diff(end))
        };
        let before = (0..first).map(|knot| beyond(knot, first));
        let inside = translations.slice(s![first..last + 1, ..]);
        let after = (last + 1..knots).map(|knot| beyond(knot, last));
        Some(Tensor::cat(before.chain([inside]).chain(after).collect(), 0))
    }

    /// `[1 + K, 3 B]`, shares of the unit: the middle of the object that each node belongs to, before anything moves and then knots
    /// of its way. An object is all Gaussians that move like those which follow the node.
    fn ways_of_objects(&self, scene: &SceneAtRest<'_>) -> Tensor<2> {
        let skinned = self.plain_numbers(scene);
        let unit: f32 = self.unit.val().into_scalar();
        let segments = self.knots() - 3;
        let poses: Vec<PosesAt> = (0..=segments).map(|end| self.poses_at(end as f32 / segments as f32)).collect();
        let rest: Vec<[f32; 3]> = skinned.means.iter().map(|mean| mean.map(|x| x / unit)).collect();
        let followed: Vec<_> = (0..rest.len()).map(|i| skinned.weights(i)).collect();
        // Of each Gaussian, three numbers a time.
        let displacements = |i: usize| -> Vec<f32> {
            let displaced = |poses: &PosesAt| {
                let place = poses.blended(&followed[i], &skinned.means[i]);
                std::array::from_fn::<f32, 3, _>(|axis| place[axis] / unit - rest[i][axis])
            };
            poses.iter().flat_map(displaced).collect()
        };
        let displacements: Vec<Vec<f32>> = (0..rest.len()).map(displacements).collect();
        let mut rows = vec![vec![0.0; 3 * self.nodes()]; 1 + self.knots()];
        for node in 0..self.nodes() {
            let of_node = |i: usize| followed[i].iter().find(|(at, _)| *at == node).map_or(0.0, |(_, weight)| *weight);
            let own = weighted_mean(&displacements, |i| skinned.opacities[i] * of_node(i).powi(2));
            let alike = |i: usize| {
                let squares = own.iter().zip(&displacements[i]).map(|(a, b)| (a - b).powi(2));
                let off = squares.sum::<f32>() / poses.len() as f32;
                skinned.opacities[i] * (-off / (2.0 * ALIKE * ALIKE)).exp()
            };
            let weights: Vec<f32> = (0..rest.len()).map(alike).collect();
            let middle = weighted_mean(&rest, |i| weights[i]);
            let way = weighted_mean(&displacements, |i| weights[i]);
            for axis in 0..3 {
                let places: Vec<f32> = way.iter().skip(axis).step_by(3).map(|moved| middle[axis] + moved).collect();
                let knots = knots_through(&places);
                for (row, value) in rows.iter_mut().zip([vec![middle[axis]], knots].concat()) {
                    row[3 * node + axis] = value;
                }
            }
        }
        tensor(rows.concat(), [1 + self.knots(), 3 * self.nodes()], &self.device())
    }
}

/// The mean of rows by their weights; zeros if none has one.
fn weighted_mean(rows: &[impl AsRef<[f32]>], weight: impl Fn(usize) -> f32) -> Vec<f32> {
    let mut sums = vec![0.0; rows.first().map_or(0, |row| row.as_ref().len())];
    let mut total = 0.0;
    for (i, row) in rows.iter().enumerate() {
        let weight = weight(i);
        if weight > LEAST_WEIGHT {
            total += weight;
            sums.iter_mut().zip(row.as_ref()).for_each(|(sum, value)| *sum += weight * value);
        }
    }
    sums.iter_mut().for_each(|sum| *sum /= f32::max(total, LEAST_WEIGHT));
    sums
}
