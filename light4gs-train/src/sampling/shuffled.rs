//! Any frames, in an order that is shuffled anew whenever all have been used.

use light4gs_keys::keys;
use rand::seq::SliceRandom;

use super::{BatchRequest, FrameSampler};

keys! {
    /// Any frames, in an order that is shuffled anew whenever all have been used. The default.
    pub struct Shuffled {}
}

impl FrameSampler for Shuffled {
    fn batch(&self, request: &BatchRequest) -> Vec<usize> {
        let frames = &request.candidates.frames;
        let first = (request.iteration - 1) * request.batch_size;
        let positions: Vec<usize> = (first..first + request.batch_size).collect();
        // A batch may begin in one pass over the frames and end in a later one.
        let passes = positions.chunk_by(|a, b| a / frames.len() == b / frames.len());
        let of_pass = |positions: &[usize]| -> Vec<usize> {
            let mut order: Vec<usize> = (0..frames.len()).collect();
            order.shuffle(&mut request.generator(positions[0] / frames.len()));
            positions.iter().map(|position| frames[order[position % frames.len()]]).collect()
        };
        passes.flat_map(of_pass).collect()
    }
}
