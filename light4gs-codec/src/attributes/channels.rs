//! Coding the channels of an attribute.

use super::{
    neighbors::NEIGHBORS,
    prediction::{Channel, LinearPrediction},
};
use crate::adaptive::{AdaptiveInteger, BitCoder, BitDecoder, BitEncoder, Damaged, magnitude_level};

/// The last level of an expected residual: 64 steps.
const LAST_LEVEL: usize = 13;
/// The most that a residual counts for the context, so that one extreme value does not spoil the contexts of its
/// neighbors.
const LARGEST_RESIDUAL: u32 = 1 << 16;

/// A channel is predicted from at most this many channels before it, so that the time for a wide attribute grows only
/// linearly.
const MOST_BEFORE: usize = 7;

/// Writes the channels of an attribute, each with a value for every Gaussian.
pub(crate) fn encode(channels: &[Vec<i32>], neighbors: &[[u32; NEIGHBORS]]) -> Vec<u8> {
    let mut encoder = BitEncoder::default();
    code(&mut encoder, &mut channels.to_vec(), neighbors, true).expect("an encoder is never damaged");
    encoder.finish()
}

/// Reads `count` channels.
pub(crate) fn decode(bytes: &[u8], count: usize, neighbors: &[[u32; NEIGHBORS]]) -> Result<Vec<Vec<i32>>, Damaged> {
    let mut channels = vec![vec![0; neighbors.len()]; count];
    code(&mut BitDecoder::new(bytes), &mut channels, neighbors, false)?;
    Ok(channels)
}

/// Codes channel after channel: mean and weights of its prediction, then the residuals.
///
/// The context of a residual is its expected magnitude, from the residuals of the neighbors, and from that of the same
/// Gaussian in the channel before.
fn code(
    coder: &mut impl BitCoder,
    channels: &mut [Vec<i32>],
    neighbors: &[[u32; NEIGHBORS]],
    encoding: bool,
) -> Result<(), Damaged> {
    let mut numbers = AdaptiveInteger::new(1);
    let mut before: Vec<Channel> = Vec::with_capacity(channels.len());
    let mut missed: Vec<u32> = Vec::new();
    for values in channels.iter_mut() {
        let mean = numbers.code(coder, 0, mean(values));
        let mut own = Channel::new(std::mem::take(values), mean);
        let last = &before[before.len().saturating_sub(MOST_BEFORE)..];
        let mut prediction = LinearPrediction::zero(last.len());
        if encoding {
            let mut whole = own.clone();
            neighbors.iter().for_each(|near| whole.gather(near));
            prediction = LinearPrediction::fit(&whole, last, neighbors);
        }
        prediction.code(coder, &mut numbers);

        let mut residuals = AdaptiveInteger::new(LAST_LEVEL + 1);
        let missed_before = std::mem::replace(&mut missed, Vec::with_capacity(neighbors.len()));
        for (index, near) in neighbors.iter().enumerate() {
            coder.check()?;
            own.gather(near);
            let predicted = prediction.predict(&own, last, near, index);
            let level = expected_level(&missed, missed_before.get(index), near);
            let residual = residuals.code(coder, level, own.values[index].wrapping_sub(predicted));
            own.values[index] = predicted.wrapping_add(residual);
            missed.push(residual.unsigned_abs().min(LARGEST_RESIDUAL));
        }
        before.push(own);
    }
    for (values, channel) in channels.iter_mut().zip(before) {
        *values = channel.values;
    }
    coder.check()
}

/// The context of the next residual, from those before it and the one in the channel before.
#[inline]
fn expected_level(missed: &[u32], missed_before: Option<&u32>, near: &[u32; NEIGHBORS]) -> usize {
    if missed.is_empty() {
        return LAST_LEVEL;
    }
    let around: u64 = near.iter().map(|&other| u64::from(missed[other as usize])).sum();
    let before = missed_before.map_or(around, |&missed| NEIGHBORS as u64 * u64::from(missed));
    magnitude_level((around + before) / NEIGHBORS as u64, LAST_LEVEL)
}

fn mean(values: &[i32]) -> i32 {
    let sum: i64 = values.iter().map(|&value| i64::from(value)).sum();
    (sum / values.len().max(1) as i64) as i32
}
