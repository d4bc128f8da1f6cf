//! Linear prediction of a channel from values that a decoder already has.
//!
//! The encoder fits the weights by least squares, in floating point, and writes them. Encoder and decoder then predict
//! with integers. So the fit need not be exact to the bit, and no two machines can disagree about a prediction.

use super::neighbors::NEIGHBORS;
use crate::adaptive::{AdaptiveInteger, BitCoder};

/// Fractional bits of a weight.
const FRACTION: u32 = 12;
/// With fewer Gaussians, weights take more bytes than they save.
const FEWEST: usize = 200;
/// Added to the diagonal of the normal equations for each Gaussian, so that channels without variation can be solved.
const RIDGE: f64 = 1e-3;

/// A channel: its values, and the sums over each Gaussian's neighbors.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub(super) values: Vec<i32>,
    mean: i32,
    /// For each Gaussian the sum over its neighbors of value minus mean; 0 for the first, which has none.
    around: Vec<i64>,
}

impl Channel {
    /// A channel with a given mean, without sums yet.
    pub(super) fn new(values: Vec<i32>, mean: i32) -> Self {
        let around = Vec::with_capacity(values.len());
        Self { values, mean, around }
    }

    /// Value minus mean.
    #[inline]
    fn centered(&self, index: usize) -> i64 {
        i64::from(self.values[index]) - i64::from(self.mean)
    }

    /// Adds the sum of the next Gaussian; its neighbors come before it.
    #[inline]
    pub(super) fn gather(&mut self, neighbors: &[u32; NEIGHBORS]) {
        let index = self.around.len();
        let sum = if index == 0 { 0 } else { neighbors.iter().map(|&other| self.centered(other as usize)).sum() };
        self.around.push(sum);
    }
}

/// What a channel is predicted from: the sum over the neighbors, the nearest neighbor, and for every channel coded
/// before it the Gaussian's own value and the sum over its neighbors. The channel's mean is subtracted from every
/// value.
#[inline]
fn inputs<'a>(
    own: &'a Channel,
    before: &'a [Channel],
    neighbors: &'a [u32; NEIGHBORS],
    index: usize,
) -> impl Iterator<Item = i64> + 'a {
    let nearest = if index == 0 { 0 } else { own.centered(neighbors[0] as usize) };
    let others = before.iter().flat_map(move |channel| [channel.centered(index), channel.around[index]]);
    [own.around[index], nearest].into_iter().chain(others)
}

/// The weights of a prediction.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LinearPrediction {
    /// In units of `2^-FRACTION`, of 16 bits, so that no sum can overflow.
    weights: Vec<i16>,
}

impl LinearPrediction {
    /// All weights zero, for a channel with `before` channels before it.
    pub(super) fn zero(before: usize) -> Self {
        Self { weights: vec![0; 2 + 2 * before] }
    }

    /// The weights of the least squared error over all Gaussians.
    pub(super) fn fit(own: &Channel, before: &[Channel], neighbors: &[[u32; NEIGHBORS]]) -> Self {
        let mut prediction = Self::zero(before.len());
        if neighbors.len() < FEWEST {
            return prediction;
        }
        let exact = least_squares(prediction.weights.len(), neighbors.len(), RIDGE, |index, row| {
            for (number, input) in row.iter_mut().zip(inputs(own, before, &neighbors[index], index)) {
                *number = input as f64;
            }
            own.centered(index) as f64
        });
        for (weight, exact) in prediction.weights.iter_mut().zip(exact) {
            *weight = (exact * f64::from(1 << FRACTION)).round() as i16;
        }
        prediction
    }

    /// Codes the weights.
    pub(super) fn code(&mut self, coder: &mut impl BitCoder, numbers: &mut AdaptiveInteger) {
        for weight in &mut self.weights {
            *weight = numbers.code(coder, 0, (*weight).into()) as i16;
        }
    }

    /// The expected value of a channel at a Gaussian.
    #[inline]
    pub(super) fn predict(&self, own: &Channel, before: &[Channel], neighbors: &[u32; NEIGHBORS], index: usize) -> i32 {
        let inputs = inputs(own, before, neighbors, index);
        let sum: i64 = self.weights.iter().zip(inputs).map(|(&weight, input)| i64::from(weight) * input).sum();
        let rounded = (sum + (1 << (FRACTION - 1))) >> FRACTION;
        // Only damaged streams have sums beyond 32 bits.
        own.mean.wrapping_add(rounded as i32)
    }
}

/// The weights with which `inputs` numbers predict another with the least squared error, over `count` examples. `example`
/// sets the inputs of one of them, and returns what they predict. `ridge` is added to the diagonal of the normal equations
/// for each example, so that inputs without variation do no harm.
pub fn least_squares(
    inputs: usize,
    count: usize,
    ridge: f64,
    mut example: impl FnMut(usize, &mut [f64]) -> f64,
) -> Vec<f64> {
    // The right side is the last column.
    let mut equations = vec![vec![0.0; inputs + 1]; inputs];
    let mut row = vec![0.0; inputs + 1];
    for index in 0..count {
        row[inputs] = example(index, &mut row[..inputs]);
        for (equation, &number) in equations.iter_mut().zip(&row) {
            equation.iter_mut().zip(&row).for_each(|(sum, other)| *sum += number * other);
        }
    }
    for (diagonal, equation) in equations.iter_mut().enumerate() {
        equation[diagonal] += ridge * count as f64;
    }
    solve(equations)
}

/// Solves positive definite equations whose last column is the right side, by elimination.
fn solve(mut equations: Vec<Vec<f64>>) -> Vec<f64> {
    let size = equations.len();
    for pivot in 0..size {
        let (done, below) = equations.split_at_mut(pivot + 1);
        let row = &done[pivot];
        for equation in below {
            let factor = equation[pivot] / row[pivot];
            equation[pivot..].iter_mut().zip(&row[pivot..]).for_each(|(number, above)| *number -= factor * above);
        }
    }
    let mut solution = vec![0.0; size];
    for row in (0..size).rev() {
        let known: f64 = (row + 1..size).map(|column| equations[row][column] * solution[column]).sum();
        solution[row] = (equations[row][size] - known) / equations[row][row];
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved() {
        let solution = solve(vec![vec![4.0, 1.0, 2.0, 12.0], vec![1.0, 3.0, 0.0, 7.0], vec![2.0, 0.0, 5.0, 17.0]]);
        for (found, expected) in solution.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12, "{solution:?}");
        }
    }

    /// A channel that is half of another is predicted as that.
    #[test]
    fn a_linear_relation_is_found() {
        let neighbors: Vec<[u32; NEIGHBORS]> = (0..1000_u32).map(|i| [i.saturating_sub(1); NEIGHBORS]).collect();
        let channel = |scale: i32| {
            let values = (0..1000_i32).map(|i| scale * (i.wrapping_mul(7919) % 101)).collect();
            let mut channel = Channel::new(values, 50 * scale);
            neighbors.iter().for_each(|near| channel.gather(near));
            channel
        };
        let (whole, half) = (channel(2), channel(1));
        let before = [whole];
        let prediction = LinearPrediction::fit(&half, &before, &neighbors);
        let exact =
            (0..1000).filter(|&i| prediction.predict(&half, &before, &neighbors[i], i) == half.values[i]).count();
        assert!(exact > 990, "{exact} of 1000");
    }
}
