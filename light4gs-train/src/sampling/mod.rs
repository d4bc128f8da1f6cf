//! Samplers choose the training frames of an iteration.
//!
//! - this file: [`FrameSampler`], the trainer's interface to a sampler, and [`SamplerKind`], the built-in ones by name
//! - `shuffled`, `same_time`, `widening_window`: one file each
//! - `candidates`: the frames that a stage may use

mod candidates;
mod same_time;
mod shuffled;
mod widening_window;

use light4gs_data::Frame;
use rand::Rng;

pub use candidates::CandidateFrames;
pub(crate) use candidates::StageFrames;
pub use same_time::SameTime;
pub use shuffled::Shuffled;
pub use widening_window::WideningWindow;

use crate::keys::kinds;
use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

kinds! {
    /// The built-in samplers, by the names that `train.sampling` takes.
    pub enum SamplerKind: "sampler" {
        Shuffled = shuffled: Shuffled,
        SameTime = same_time: SameTime,
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
    /// Those of them that the stage may use; not empty.
    pub candidates: &'a CandidateFrames,
    /// Frames that an iteration should have, at least 1.
    pub batch_size: usize,
    /// The stage.
    pub stage: Stage,
    /// Iteration of the stage, from 1. It may be beyond the end of the stage, since images are decoded ahead.
    pub iteration: usize,
    /// Iterations of the stage.
    pub iterations: usize,
    /// Of the run.
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

    use super::same_time::batches_a_pass;
    use super::*;

    const KINDS: [SamplerKind; 2] = [SamplerKind::Shuffled, SamplerKind::SameTime];

    /// `cameras` views of each of `times` times.
    fn frames(cameras: usize, times: usize) -> Vec<Frame> {
        let camera = Camera::look_at([4.0, 0.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 8, 8);
        let frame = |k: usize| Frame::without_image(format!("{k}"), camera, (k % times) as f32 / times as f32);
        (0..cameras * times).map(frame).collect()
    }

    /// The sampler of a kind, for a stage and an iteration.
    fn sampler<'a>(
        kind: SamplerKind,
        batch_size: usize,
        coarse_times: Option<usize>,
        frames: &'a [Frame],
    ) -> impl Fn(u64, Stage, usize) -> Vec<usize> + 'a {
        let sampler = Samplers::default().of(kind);
        let candidates = StageFrames::new(coarse_times, frames);
        move |seed, stage, iteration| {
            let candidates = candidates.of(stage);
            sampler.batch(&BatchRequest { frames, candidates, batch_size, stage, iteration, iterations: 100, seed })
        }
    }

    #[test]
    fn a_pass_sees_every_frame() {
        for (cameras, times, batch) in [(5, 4, 2), (4, 3, 4), (1, 7, 1), (1, 6, 2), (3, 5, 4), (6, 1, 4), (1, 2, 5)] {
            let frames = frames(cameras, times);
            for kind in KINDS {
                let sampler = sampler(kind, batch, None, &frames);
                let same_time = batches_a_pass(&StageFrames::new(None, &frames).of(Stage::Fine).times, batch);
                let length = if kind == SamplerKind::SameTime { same_time } else { frames.len().div_ceil(batch) };
                let seen: Vec<Vec<usize>> = (1..=length).map(|i| sampler(3, Stage::Fine, i)).collect();
                assert!(seen.iter().all(|views| views.len() == batch));
                let different: BTreeSet<usize> = seen.into_iter().flatten().collect();
                assert_eq!(different.len(), frames.len(), "{kind} {cameras} {times} {batch}");
            }
        }
    }

    /// The frames on which existing runs have been trained: these draws must not change.
    #[test]
    fn batches_are_what_they_always_were() {
        let frames = frames(3, 4);
        let of = |kind| -> Vec<Vec<usize>> {
            let sampler = sampler(kind, 2, None, &frames);
            [1, 2, 6, 7, 8].map(|i| sampler(5, Stage::Fine, i)).to_vec()
        };
        assert_eq!(of(SamplerKind::Shuffled), [[0, 10], [7, 2], [8, 4], [1, 9], [0, 2]]);
        assert_eq!(of(SamplerKind::SameTime), [[0, 8], [4, 0], [3, 11], [6, 10], [2, 6]]);
    }

    #[test]
    fn a_batch_shows_one_time_from_different_cameras() {
        let frames = frames(5, 6);
        let sampler = sampler(SamplerKind::SameTime, 4, None, &frames);
        let mut times = BTreeSet::new();
        for iteration in 1..=24 {
            let batch = sampler(0, Stage::Fine, iteration);
            assert!(batch.iter().all(|view| frames[*view].time == frames[batch[0]].time));
            assert_eq!(batch.iter().collect::<BTreeSet<_>>().len(), 4, "{batch:?}");
            times.insert(frames[batch[0]].time.to_bits());
        }
        assert_eq!(times.len(), 6);
    }

    #[test]
    fn the_coarse_stage_may_see_the_first_times_only() {
        let frames = frames(3, 5);
        for kind in KINDS {
            let sampler = sampler(kind, 2, Some(2), &frames);
            let latest = |stage| {
                let views: Vec<usize> = (1..=40).flat_map(|i| sampler(1, stage, i)).collect();
                views.iter().map(|view| frames[*view].time).fold(0.0, f32::max)
            };
            assert_eq!((latest(Stage::Coarse), latest(Stage::Fine)), (0.2, 0.8));
        }
    }
}
