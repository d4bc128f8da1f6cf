//! The training frames that a stage may use.

use std::collections::BTreeMap;

use light4gs_data::Frame;

use crate::stage::Stage;

/// The training frames that a stage may use, by their indices in the training split.
#[derive(Clone, Debug, Default)]
pub struct CandidateFrames {
    /// In the order of the dataset.
    pub frames: Vec<usize>,
    /// The same by time, the earliest first: several for each time where there are several cameras.
    pub times: Vec<Vec<usize>>,
}

/// The candidates of both stages.
#[derive(Debug)]
pub(crate) struct StageFrames([CandidateFrames; 2]);

impl StageFrames {
    /// From the training split. The coarse stage uses only the first `coarse_times` times, if that is given.
    pub(crate) fn new(coarse_times: Option<usize>, frames: &[Frame]) -> Self {
        let mut times: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (index, frame) in frames.iter().enumerate() {
            // Times are not negative, so their bits have the same order.
            times.entry(frame.time.max(0.0).to_bits()).or_default().push(index);
        }
        let all: Vec<Vec<usize>> = times.into_values().collect();
        let first = coarse_times.unwrap_or(all.len()).min(all.len());
        Self([all[..first].to_vec(), all].map(|times| {
            let mut frames = times.concat();
            frames.sort_unstable();
            CandidateFrames { frames, times }
        }))
    }

    /// Those of a stage.
    pub(crate) fn of(&self, stage: Stage) -> &CandidateFrames {
        let Self([coarse, fine]) = self;
        match stage {
            Stage::Coarse => coarse,
            Stage::Fine => fine,
        }
    }
}
