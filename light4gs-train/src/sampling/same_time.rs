//! Different cameras at one time.

use rand::Rng;
use rand::seq::SliceRandom;

use super::{BatchRequest, FrameSampler};
use crate::keys::keys;

keys! {
    /// Different cameras at one time. Where a time has fewer cameras than a batch has frames, the batch continues with
    /// another time.
    pub struct SameTime {}
}

impl FrameSampler for SameTime {
    fn batch(&self, request: &BatchRequest) -> Vec<usize> {
        let times = &request.candidates.times;
        let length = batches_a_pass(times, request.batch_size);
        let (pass, position) = ((request.iteration - 1) / length, (request.iteration - 1) % length);
        let mut batches = batches_of_one_time(times, request.batch_size, &mut request.generator(pass));
        batches.swap_remove(position)
    }
}

/// Whether every time has enough frames to fill a batch.
fn times_fill_batches(times: &[Vec<usize>], batch: usize) -> bool {
    times.iter().all(|frames| frames.len() >= batch)
}

pub(super) fn batches_a_pass(times: &[Vec<usize>], batch: usize) -> usize {
    match times_fill_batches(times, batch) {
        true => times.iter().map(|frames| frames.len().div_ceil(batch)).sum(),
        false => times.iter().map(Vec::len).sum::<usize>().div_ceil(batch),
    }
}

/// Batches in which all frames have one time; each frame is in at least one. If a time has fewer frames than a batch
/// needs, the batch continues with the next time in the order, so that a single moving camera works too.
fn batches_of_one_time(times: &[Vec<usize>], batch: usize, random: &mut impl Rng) -> Vec<Vec<usize>> {
    let mut times = times.to_vec();
    times.shuffle(random);
    times.iter_mut().for_each(|frames| frames.shuffle(random));
    let filled = |frames: &[usize], others: &[usize]| -> Vec<usize> {
        frames.iter().chain(others).copied().take(batch).collect()
    };
    if times_fill_batches(&times, batch) {
        let of_time = |frames: &Vec<usize>| -> Vec<Vec<usize>> {
            frames.chunks(batch).map(|part| filled(part, frames)).collect()
        };
        return times.iter().flat_map(of_time).collect();
    }
    let order: Vec<usize> = times.concat();
    let cycle: Vec<usize> = order.iter().copied().cycle().take(batch).collect();
    order.chunks(batch).map(|part| filled(part, &cycle)).collect()
}
