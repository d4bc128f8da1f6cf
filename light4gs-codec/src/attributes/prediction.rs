//! Linear prediction of a channel from values that a decoder already has.
//!
//! The encoder fits the weights by robust least squares, in floating point, and writes them. Encoder and decoder then predict
//! with integers. So the fit need not be exact to the bit, and no two machines can disagree about a prediction.

use super::{least_squares::robust_least_squares, neighbors::NEIGHBORS};
use crate::adaptive::{AdaptiveInteger, BitCoder};

/// Fractional bits of a weight.
const FRACTION: u32 = 9;
/// With fewer Gaussians, weights take more bytes than they save.
const FEWEST: usize = 200;
/// Inputs of a prediction that come from the channel itself.
const OWN: usize = 2;
/// Added to the diagonal of the normal equations for each Gaussian, so that channels without variation can be solved.
const RIDGE: f64 = 1e-3;

/// A channel: its values, and the sums over each Gaussian's neighbors.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    pub(super) values: Vec<i32>,
    center: i32,
    /// For each Gaussian the sum over its neighbors of value minus center; 0 for the first, which has none.
    around: Vec<i64>,
}

impl Channel {
    /// A channel with a given center, without sums yet.
    pub(super) fn new(values: Vec<i32>, center: i32) -> Self {
        let around = Vec::with_capacity(values.len());
        Self { values, center, around }
    }

    /// Value minus center.
    #[inline]
    fn centered(&self, index: usize) -> i64 {
        i64::from(self.values[index]) - i64::from(self.center)
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
/// before it the Gaussian's own value and the sum over its neighbors. The channel's center is subtracted
/// from every value.
fn inputs<'a>(
    own: &'a Channel,
    before: &'a [Channel],
    neighbors: &'a [u32; NEIGHBORS],
    index: usize,
) -> impl Iterator<Item = i64> + 'a {
    let others = before.iter().flat_map(move |channel| [channel.centered(index), channel.around[index]]);
    own_inputs(own, neighbors, index).into_iter().chain(others)
}

/// The inputs that come from the channel itself.
#[inline]
fn own_inputs(own: &Channel, neighbors: &[u32; NEIGHBORS], index: usize) -> [i64; OWN] {
    let nearest = if index == 0 { 0 } else { own.centered(neighbors[0] as usize) };
    [own.around[index], nearest]
}

/// What a Gaussian's number is expected to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prediction {
    /// The nearest integer.
    pub(super) value: i32,
    /// What was rounded away, in `-HALF..HALF`: where it is positive, the number is rather larger than the integer.
    beyond: i32,
}

/// Half a step in the units of [`Prediction::beyond`].
const HALF: u32 = 1 << (FRACTION - 1);

impl Prediction {
    /// The number minus the integer, with the sign such that a positive one is at least as likely as a negative one; its
    /// own inverse.
    #[inline]
    pub(super) fn turn(&self, residual: i32) -> i32 {
        if self.beyond < 0 { residual.wrapping_neg() } else { residual }
    }

    /// How far the integer is from what was predicted: `0..parts`, from no distance to half a step.
    #[inline]
    pub(super) fn distance(&self, parts: usize) -> usize {
        (self.beyond.unsigned_abs() as usize * parts / HALF as usize).min(parts - 1)
    }
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
        Self { weights: vec![0; OWN + 2 * before] }
    }

    /// The weights that leave the fewest bits, about. The bits of a residual grow with the logarithm of its size: few large
    /// ones do not matter, as they would in a sum of squares.
    pub(super) fn fit(own: &Channel, before: &[Channel], neighbors: &[[u32; NEIGHBORS]]) -> Self {
        let mut prediction = Self::zero(before.len());
        if neighbors.len() < FEWEST {
            return prediction;
        }
        let exact = robust_least_squares(prediction.weights.len(), neighbors.len(), RIDGE, |index, row| {
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

    /// For each of `count` Gaussians, what the channels before say: all at once, since these are complete.
    pub(super) fn of_channels(&self, before: &[Channel], count: usize) -> Vec<i64> {
        let mut sums = vec![0; count];
        for (channel, weights) in before.iter().zip(self.weights[OWN..].as_chunks::<2>().0) {
            let [at_it, around] = weights.map(i64::from);
            let center = i64::from(channel.center);
            for ((sum, &value), &others) in sums.iter_mut().zip(&channel.values).zip(&channel.around) {
                *sum += at_it * (i64::from(value) - center) + around * others;
            }
        }
        sums
    }

    /// What is expected of a channel at a Gaussian, for which [`LinearPrediction::of_channels`] has this.
    #[inline]
    pub(super) fn predict(
        &self,
        own: &Channel,
        of_channels: i64,
        neighbors: &[u32; NEIGHBORS],
        index: usize,
    ) -> Prediction {
        let inputs = own_inputs(own, neighbors, index);
        let sum = of_channels + i64::from(self.weights[0]) * inputs[0] + i64::from(self.weights[1]) * inputs[1];
        let rounded = (sum + (1 << (FRACTION - 1))) >> FRACTION;
        // Only damaged streams have sums beyond 32 bits.
        let beyond = (sum - (rounded << FRACTION)) as i32;
        Prediction { value: own.center.wrapping_add(rounded as i32), beyond }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let of_channels = prediction.of_channels(&before, neighbors.len());
        let is_exact =
            |i: &usize| prediction.predict(&half, of_channels[*i], &neighbors[*i], *i).value == half.values[*i];
        let exact = (0..1000).filter(is_exact).count();
        assert!(exact > 990, "{exact} of 1000");
    }
}
