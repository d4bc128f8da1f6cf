//! Coding the channels of an attribute.

use super::{
    neighbors::NEIGHBORS,
    prediction::{Channel, LinearPrediction, Prediction},
};
use crate::adaptive::{AdaptiveInteger, BitCoder, BitDecoder, BitEncoder, Damaged, magnitude_level};

/// The last level of an expected residual: 64 steps.
const LAST_LEVEL: usize = 13;
/// The levels up to which flag and sign of a residual know how far its prediction was rounded, and in how many parts of
/// half a step. Where residuals are larger, that says nothing.
const EXACT_LEVELS: usize = 2;
const EXACT_PARTS: usize = 4;
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

/// Codes channel after channel: center and weights of its prediction, then the residuals.
///
/// The context of a residual is its expected magnitude, from the residuals of the neighbors, and from that of the same
/// Gaussian in the channel before. All channels have the same statistics: a channel of a few thousand small numbers would
/// spend a good part of its bits on learning its own.
fn code(
    coder: &mut impl BitCoder,
    channels: &mut [Vec<i32>],
    neighbors: &[[u32; NEIGHBORS]],
    encoding: bool,
) -> Result<(), Damaged> {
    let mut numbers = AdaptiveInteger::new(1);
    let mut before: Vec<Channel> = Vec::with_capacity(channels.len());
    let mut missed: Vec<u32> = Vec::new();
    let mut residuals = AdaptiveInteger::with_signs(LAST_LEVEL + 1, LAST_LEVEL + 1 + EXACT_LEVELS * (EXACT_PARTS - 1));
    for values in channels.iter_mut() {
        let center = numbers.code(coder, 0, if encoding { center(values) } else { 0 });
        let mut own = Channel::new(std::mem::take(values), center);
        let last = &before[before.len().saturating_sub(MOST_BEFORE)..];
        let mut prediction = LinearPrediction::zero(last.len());
        if encoding {
            let mut whole = own.clone();
            neighbors.iter().for_each(|near| whole.gather(near));
            prediction = LinearPrediction::fit(&whole, last, neighbors);
        }
        prediction.code(coder, &mut numbers);
        let of_channels = prediction.of_channels(last, neighbors.len());

        let missed_before = std::mem::replace(&mut missed, Vec::with_capacity(neighbors.len()));
        for (index, near) in neighbors.iter().enumerate() {
            coder.check()?;
            own.gather(near);
            let predicted = prediction.predict(&own, of_channels[index], near, index);
            let level = expected_level(&missed, missed_before.get(index), near);
            let sign = sign_context(level, &predicted);
            // Where residuals are larger than a step, their sides are not alike, and keep their signs.
            let turn = |residual| if level < EXACT_LEVELS { predicted.turn(residual) } else { residual };
            let residual = turn(own.values[index].wrapping_sub(predicted.value));
            let residual = residuals.code_with_sign(coder, level, sign, residual);
            own.values[index] = predicted.value.wrapping_add(turn(residual));
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

/// The context of a residual's flag and sign.
#[inline]
fn sign_context(level: usize, predicted: &Prediction) -> usize {
    match level.checked_sub(EXACT_LEVELS) {
        None => level * EXACT_PARTS + predicted.distance(EXACT_PARTS),
        Some(beyond) => EXACT_LEVELS * EXACT_PARTS + beyond,
    }
}

/// The median: what a channel is where nothing else tells.
fn center(values: &[i32]) -> i32 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    if values.is_empty() { 0 } else { *values.select_nth_unstable(middle).1 }
}
