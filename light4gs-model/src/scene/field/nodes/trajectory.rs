//! Trajectories: uniform cubic B-splines over time, and the places of nodes on them.

use std::ops::Range;

use burn::tensor::{Device, Int, Tensor, TensorData, s};

use super::NodesField;
use crate::ops::node_poses::pose;

/// Products of the quaternion's components (w, x, y, z) that a rotation matrix is made of: xx yy zz, xy yz xz, wz wx wy.
pub(super) const FACTORS: [[usize; 9]; 2] = [[1, 2, 3, 1, 2, 1, 0, 0, 0], [1, 2, 3, 2, 3, 3, 3, 1, 2]];
/// The diagonal is 1 - 2 (a + b) of these products.
pub(super) const DIAGONAL: [[usize; 3]; 2] = [[1, 0, 0], [2, 2, 1]];
/// The other elements are 2 (a - b) and 2 (a + b) of these.
pub(super) const OTHERS: [[usize; 3]; 2] = [[3, 4, 5], [6, 7, 8]];
/// The nine elements, row by row, as indices into diagonal, differences and sums, one behind the other.
pub(super) const ELEMENTS: [usize; 9] = [0, 3, 8, 6, 1, 4, 5, 7, 2];

/// Columns of a tensor by their numbers.
pub(super) fn columns(tensor: &Tensor<2>, numbers: &[usize]) -> Tensor<2> {
    let numbers: Vec<i64> = numbers.iter().map(|number| *number as i64).collect();
    tensor.clone().select(1, Tensor::<1, Int>::from_data(TensorData::from(&numbers[..]), &tensor.device()))
}

/// A continued trajectory: the difference between two successive knots, divided by the difference before.
const DAMPING: f32 = 0.9;

/// The first and the last of `knots` knots that the times from `low` to `high` touch. The outermost two do not count as
/// touched: they have next to no weight at `low` and `high`.
pub(super) fn touched(knots: usize, low: f32, high: f32) -> (usize, usize) {
    let segment = |time: f32| ((time.clamp(0.0, 1.0) * (knots - 3) as f32) as usize).min(knots - 4);
    (segment(low) + 1, segment(high) + 2)
}

/// Share of a quantity that is left `knots` knots farther on.
pub(super) fn not_damped(knots: usize) -> f32 {
    DAMPING.powi(knots as i32)
}

/// The knot with the largest weight at a time.
pub(super) fn knot_at(time: f32, knots: usize) -> usize {
    (time.clamp(0.0, 1.0) * (knots - 3) as f32 + 1.0).round() as usize
}

/// Replaces the knots `[K, C]` that the times from `low` to `high` do not touch (see [`touched`]): they continue the others,
/// slower from knot to knot.
pub(super) fn continued(knots: Tensor<2>, low: f32, high: f32) -> Tensor<2> {
    let [count, _] = knots.dims();
    let (first, last) = touched(count, low, high);
    let row = |knot: usize| knots.clone().slice(s![knot..knot + 1, ..]);
    let beyond = |at: usize, inner: usize, count: usize| -> Vec<Tensor<2>> {
        let difference = row(at) - row(inner);
        let mut step = 0.0;
        let shares = (1..=count).map(|power| {
            step += not_damped(power);
            step
        });
        shares.map(|share| row(at) + difference.clone() * share).collect()
    };
    let mut all = if low > 0.0 { beyond(first, first + 1, first) } else { (0..first).rev().map(row).collect() };
    all.reverse();
    all.extend((first..=last).map(row));
    let after = count - 1 - last;
    all.extend(if high < 1.0 { beyond(last, last - 1, after) } else { (last + 1..count).map(row).collect() });
    Tensor::cat(all, 0)
}

/// The knots of the uniform cubic B-spline through values at the ends of its segments, without curvature at both ends.
pub(super) fn knots_through(values: &[f32]) -> Vec<f32> {
    // At the end of a segment (k[j-1] + 4 k[j] + k[j+1]) / 6 is the value. Without curvature, the first and the last such knot
    // are their values; Thomas's algorithm finds those between.
    let last = values.len() - 1;
    let mut knots = values.to_vec();
    let mut factors = vec![0.0; values.len()];
    for j in 1..last {
        let pivot = 4.0 - factors[j - 1];
        factors[j] = 1.0 / pivot;
        knots[j] = (6.0 * values[j] - knots[j - 1]) / pivot;
    }
    for j in (1..last).rev() {
        knots[j] -= factors[j] * knots[j + 1];
    }
    let (before, after) = (2.0 * knots[0] - knots[1], 2.0 * knots[last] - knots[last - 1]);
    [vec![before], knots, vec![after]].concat()
}

impl NodesField {
    /// `[B, 3]`: the places of the nodes before anything moves, world units.
    pub fn world_anchors(&self) -> Tensor<2> {
        self.anchors.val() * self.unit.val().unsqueeze()
    }

    /// At a time in [0, 1], the places of the nodes, `[B, 3]`, world units, and their rotations, `[B, 4]`: unit quaternions (w,
    /// x, y, z). A node with the [anchor](Self::world_anchors) `a`, the place `p` and the rotation `R` takes a point from `x`,
    /// before anything moves, to `R (x - a) + p`.
    pub fn places(&self, time: f32) -> (Tensor<2>, Tensor<2>) {
        let nodes = pose(self.parameters(), time);
        let part = |columns: Range<usize>| nodes.clone().slice(s![.., columns]);
        let matrices = part(4..13).reshape([self.nodes(), 3, 3]);
        let turned = matrices.matmul(part(0..3).unsqueeze_dim(2)).squeeze_dim(2);
        (turned + part(13..16), part(16..20))
    }

    pub(super) fn device(&self) -> Device {
        self.anchors.device()
    }
}

/// `[B, 9]`, row by row, of unit quaternions `[B, 4]`.
pub(super) fn rotation_matrices(quats: &Tensor<2>) -> Tensor<2> {
    let terms = columns(quats, &FACTORS[0]) * columns(quats, &FACTORS[1]);
    let [first, second] = OTHERS.map(|numbers| columns(&terms, &numbers));
    let diagonal = (columns(&terms, &DIAGONAL[0]) + columns(&terms, &DIAGONAL[1])) * -2.0 + 1.0;
    let others = [(first.clone() - second.clone()) * 2.0, (first + second) * 2.0];
    columns(&Tensor::cat([vec![diagonal], others.to_vec()].concat(), 1), &ELEMENTS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::field::nodes::{numbers, tensor};

    #[test]
    fn what_is_not_seen_continues_a_line_ever_slower() {
        let device = Device::flex();
        let knots = tensor((0..10).map(|knot| knot as f32).collect(), [10, 1], &device);
        // Eight knots apart: the window touches knots 2 to 7, of which the outermost count as not seen.
        let values = numbers(continued(knots.clone(), 0.3, 0.7));
        assert_eq!(values[3..=6], [3.0, 4.0, 5.0, 6.0]);
        assert!((values[7] - 6.9).abs() < 1e-6 && (values[8] - 7.71).abs() < 1e-5, "{values:?}");
        assert!((values[2] - 2.1).abs() < 1e-6 && (values[1] - 1.29).abs() < 1e-5, "{values:?}");
        assert_eq!(numbers(continued(knots.clone(), 0.0, 1.0)), numbers(knots));
    }

    #[test]
    fn a_spline_goes_through_values() {
        for values in [vec![1.0, -3.0], vec![0.0, 1.0, -2.0, 0.5, 0.25], (0..40).map(|j| (j as f32).sin()).collect()] {
            let knots = knots_through(&values);
            assert_eq!(knots.len(), values.len() + 2);
            for (near, value) in knots.windows(3).zip(&values) {
                assert!(((near[0] + 4.0 * near[1] + near[2]) / 6.0 - value).abs() < 1e-5, "{knots:?}");
            }
        }
    }

    #[test]
    fn a_line_has_knots_on_it() {
        assert_eq!(knots_through(&[1.0, 2.0, 3.0, 4.0]).len(), 6);
        for (knot, expected) in knots_through(&[1.0, 2.0, 3.0, 4.0]).into_iter().zip([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]) {
            assert!((knot - expected).abs() < 1e-5);
        }
    }
}
