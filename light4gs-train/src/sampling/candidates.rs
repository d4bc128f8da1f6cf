//! The training frames among which a sampler chooses.

use std::collections::BTreeMap;

use light4gs_data::Frame;

/// The training frames, by their indices in the training split.
#[derive(Clone, Debug, Default)]
pub struct CandidateFrames {
    /// In the order of the dataset.
    pub frames: Vec<usize>,
    /// The same by time, the earliest first: several for each time where there are several cameras.
    pub times: Vec<Vec<usize>>,
}

impl CandidateFrames {
    /// Those of a training split.
    pub(crate) fn new(frames: &[Frame]) -> Self {
        let mut times: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (index, frame) in frames.iter().enumerate() {
            // Times are not negative, so their bits have the same order.
            times.entry(frame.time.max(0.0).to_bits()).or_default().push(index);
        }
        Self { frames: (0..frames.len()).collect(), times: times.into_values().collect() }
    }
}
