//! Samplers choose the training frames of an iteration.
//!
//! | frames | sampler |
//! |---|---|
//! | any | [`Shuffled`], the default |
//! | with objects that move too fast to be followed from one random time to another | [`WideningWindow`] |
//! | by a rule of your own | a function of a [`BatchRequest`], or another [`FrameSampler`] |
//!
//! [`SamplerKind`] has the built-in ones by name. [`CandidateFrames`] lists the frames by time.

mod candidates;
mod shuffled;
mod widening_window;

use light4gs_data::Frame;
use light4gs_keys::choice;
use rand::Rng;

pub use candidates::CandidateFrames;
pub use shuffled::Shuffled;
pub use widening_window::WideningWindow;

use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

choice! {
    /// The built-in samplers, by the names that `train.sampling` takes.
    pub enum SamplerKind: "sampler" {
        Shuffled = shuffled: Shuffled,
        WideningWindow = widening_window: WideningWindow,
    }
    /// The keys of the built-in samplers.
    pub struct Samplers: dyn FrameSampler;
}

/// The request to a sampler for the frames of one iteration.
#[derive(Clone, Copy, Debug)]
pub struct BatchRequest<'a> {
    /// The training split, with cameras and times.
    pub frames: &'a [Frame],
    /// The same by index and by time; not empty.
    pub candidates: &'a CandidateFrames,
    /// Frames that an iteration should have, at least 1.
    pub batch_size: usize,
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1. It may be beyond the end of the stage, since images are decoded ahead.
    pub iteration: usize,
    /// Iterations of the stage.
    pub iterations: usize,
    /// Seed of the run.
    pub(crate) seed: u64,
}

impl BatchRequest<'_> {
    /// A generator that depends only on the run's seed, the stage and `position`, for example the iteration, or the
    /// number of the pass over the frames. No other part of the training draws the same numbers.
    pub fn generator(&self, position: usize) -> impl Rng + use<> {
        generator(self.seed, Purpose::FrameOrder, self.stage, position)
    }
}

/// Chooses the frames of an iteration. It is called for later iterations ahead of time, so that their images are
/// decoded early, and a resumed run calls it only for the remaining ones. So the result must depend on the request
/// alone, and random numbers must be drawn from [`BatchRequest::generator`].
pub trait FrameSampler: Send + Sync {
    /// Indices into [`BatchRequest::frames`], at least one. The loss is the mean over them.
    fn batch(&self, request: &BatchRequest) -> Vec<usize>;

    /// The earliest and the latest time of the frames of this iteration and of those before it. Motion outside of them is
    /// not known yet. All times, unless a sampler overrides it.
    fn window(&self, _request: &BatchRequest) -> [f32; 2] {
        [0.0, 1.0]
    }
}

/// A function is a sampler.
impl<S: Fn(&BatchRequest) -> Vec<usize> + Send + Sync> FrameSampler for S {
    fn batch(&self, request: &BatchRequest) -> Vec<usize> {
        self(request)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use light4gs_data::Camera;

    use super::*;

    /// `cameras` views of each of `times` times.
    fn frames(cameras: usize, times: usize) -> Vec<Frame> {
        let camera = Camera::look_at([4.0, 0.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 8, 8);
        let frame = |k: usize| Frame::without_image(format!("{k}"), camera, (k % times) as f32 / times as f32);
        (0..cameras * times).map(frame).collect()
    }

    /// Shuffled frames, by a seed and an iteration.
    fn shuffled(batch_size: usize, frames: &[Frame]) -> impl Fn(u64, usize) -> Vec<usize> {
        let sampler = Samplers::default().of(SamplerKind::Shuffled);
        let candidates = CandidateFrames::new(frames);
        move |seed, iteration| {
            let (stage, candidates) = (Stage::Fine, &candidates);
            sampler.batch(&BatchRequest { frames, candidates, batch_size, stage, iteration, iterations: 100, seed })
        }
    }

    #[test]
    fn a_pass_sees_every_frame() {
        for (cameras, times, batch) in [(5, 4, 2), (4, 3, 4), (1, 7, 1), (1, 6, 2), (3, 5, 4), (6, 1, 4), (1, 2, 5)] {
            let frames = frames(cameras, times);
            let sampler = shuffled(batch, &frames);
            let seen: Vec<Vec<usize>> = (1..=frames.len().div_ceil(batch)).map(|i| sampler(3, i)).collect();
            assert!(seen.iter().all(|views| views.len() == batch));
            let different: BTreeSet<usize> = seen.into_iter().flatten().collect();
            assert_eq!(different.len(), frames.len(), "{cameras} {times} {batch}");
        }
    }

    /// The frames on which existing runs have been trained: these draws must not change.
    #[test]
    fn batches_are_what_they_always_were() {
        let frames = frames(3, 4);
        let sampler = shuffled(2, &frames);
        assert_eq!([1, 2, 6, 7, 8].map(|i| sampler(5, i)), [[0, 10], [7, 2], [8, 4], [1, 9], [0, 2]]);
    }
}
