//! Which frames an iteration looks at.
//!
//! Everything is drawn from the seed and the position in the schedule, so that a resumed run goes on with the same frames.

use std::collections::BTreeMap;

use light4gs_data::Frame;
use rand::seq::SliceRandom;

use crate::config::{Sampling, TrainConfig};
use crate::randomness::{FrameOrder, Purpose, generator};
use crate::stage::Stage;

/// Frames in an order that is made anew each time all have been seen.
#[derive(Clone, Debug)]
pub(crate) struct FrameSampler {
    sampling: Sampling,
    batch: usize,
    /// Frames of the coarse stage, and of the fine one, by time.
    times: [Vec<TimeViews>; 2],
    /// The same in the order of the dataset.
    frames: [Vec<usize>; 2],
    order: FrameOrder,
    pass: Option<(Stage, usize, Vec<Vec<usize>>)>,
}

/// Indices of the frames of one time: several where there are several cameras.
type TimeViews = Vec<usize>;

impl FrameSampler {
    /// Of a dataset's training frames, in the way that a configuration says.
    pub(crate) fn new(config: &TrainConfig, frames: &[Frame]) -> Self {
        let mut times: BTreeMap<u32, TimeViews> = BTreeMap::new();
        for (index, frame) in frames.iter().enumerate() {
            // Times are not negative, and so their bits are in their order.
            times.entry(frame.time.max(0.0).to_bits()).or_default().push(index);
        }
        let all: Vec<TimeViews> = times.into_values().collect();
        let first = config.coarse_times.unwrap_or(all.len()).min(all.len());
        let times = [all[..first].to_vec(), all];
        let frames = times.each_ref().map(|times| {
            let mut frames = times.concat();
            frames.sort_unstable();
            frames
        });
        let (sampling, batch) = (config.sampling, config.batch_size.max(1));
        Self { sampling, batch, times, frames, order: FrameOrder::default(), pass: None }
    }

    fn times(&self, stage: Stage) -> &[TimeViews] {
        &self.times[place(stage)]
    }

    /// Indices of the frames of an iteration, counted from 1: as many as a batch has.
    pub(crate) fn batch(&mut self, seed: u64, stage: Stage, iteration: usize) -> Vec<usize> {
        match self.sampling {
            Sampling::Shuffled => self.shuffled(seed, stage, iteration),
            Sampling::SameTime => self.same_time(seed, stage, iteration),
        }
    }

    fn shuffled(&mut self, seed: u64, stage: Stage, iteration: usize) -> Vec<usize> {
        let frames = &self.frames[place(stage)];
        let first = (iteration - 1) * self.batch;
        (first..first + self.batch).map(|position| frames[self.order.at(seed, stage, position, frames.len())]).collect()
    }

    fn same_time(&mut self, seed: u64, stage: Stage, iteration: usize) -> Vec<usize> {
        let length = batches_a_pass(self.times(stage), self.batch);
        let (pass, position) = ((iteration - 1) / length, (iteration - 1) % length);
        if !matches!(&self.pass, Some((known_stage, known, _)) if (*known_stage, *known) == (stage, pass)) {
            let mut random = generator(seed, Purpose::FrameOrder, stage, pass);
            let batches = batches_of_one_time(self.times(stage), self.batch, &mut random);
            self.pass = Some((stage, pass, batches));
        }
        match &self.pass {
            Some((_, _, batches)) => batches[position].clone(),
            None => Vec::new(),
        }
    }
}

fn place(stage: Stage) -> usize {
    if stage == Stage::Coarse { 0 } else { 1 }
}

/// Whether every time has enough views to fill a batch.
fn times_fill_batches(times: &[TimeViews], batch: usize) -> bool {
    times.iter().all(|views| views.len() >= batch)
}

fn batches_a_pass(times: &[TimeViews], batch: usize) -> usize {
    match times_fill_batches(times, batch) {
        true => times.iter().map(|views| views.len().div_ceil(batch)).sum(),
        false => times.iter().map(Vec::len).sum::<usize>().div_ceil(batch),
    }
}

/// Batches in which all views have one time; each view is in one at least. Where some times have fewer views than a batch
/// needs, a batch goes on with the next time in the order, so that a single moving camera works too.
fn batches_of_one_time(times: &[TimeViews], batch: usize, random: &mut impl rand::Rng) -> Vec<Vec<usize>> {
    let mut times = times.to_vec();
    times.shuffle(random);
    times.iter_mut().for_each(|views| views.shuffle(random));
    let filled =
        |views: &[usize], others: &[usize]| -> Vec<usize> { views.iter().chain(others).copied().take(batch).collect() };
    if times_fill_batches(&times, batch) {
        let of_time =
            |views: &TimeViews| -> Vec<Vec<usize>> { views.chunks(batch).map(|part| filled(part, views)).collect() };
        return times.iter().flat_map(of_time).collect();
    }
    let order: Vec<usize> = times.concat();
    let cycle: Vec<usize> = order.iter().copied().cycle().take(batch).collect();
    order.chunks(batch).map(|part| filled(part, &cycle)).collect()
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

    fn sampler(sampling: Sampling, batch_size: usize, coarse_times: Option<usize>, frames: &[Frame]) -> FrameSampler {
        FrameSampler::new(&TrainConfig { sampling, batch_size, coarse_times, ..TrainConfig::default() }, frames)
    }

    #[test]
    fn a_pass_sees_every_frame() {
        for (cameras, times, batch) in [(5, 4, 2), (4, 3, 4), (1, 7, 1), (1, 6, 2), (3, 5, 4), (6, 1, 4)] {
            let frames = frames(cameras, times);
            for sampling in [Sampling::Shuffled, Sampling::SameTime] {
                let mut sampler = sampler(sampling, batch, None, &frames);
                let length = match sampling {
                    Sampling::Shuffled => frames.len().div_ceil(batch),
                    Sampling::SameTime => batches_a_pass(sampler.times(Stage::Fine), batch),
                };
                let seen: Vec<Vec<usize>> = (1..=length).map(|i| sampler.batch(3, Stage::Fine, i)).collect();
                assert!(seen.iter().all(|views| views.len() == batch));
                let different: BTreeSet<usize> = seen.into_iter().flatten().collect();
                assert_eq!(different.len(), frames.len(), "{sampling} {cameras} {times} {batch}");
            }
        }
    }

    #[test]
    fn a_batch_shows_one_time_from_different_cameras() {
        let frames = frames(5, 6);
        let mut sampler = sampler(Sampling::SameTime, 4, None, &frames);
        let mut times = BTreeSet::new();
        for iteration in 1..=24 {
            let batch = sampler.batch(0, Stage::Fine, iteration);
            assert!(batch.iter().all(|view| frames[*view].time == frames[batch[0]].time));
            assert_eq!(batch.iter().collect::<BTreeSet<_>>().len(), 4, "{batch:?}");
            times.insert(frames[batch[0]].time.to_bits());
        }
        assert_eq!(times.len(), 6);
    }

    #[test]
    fn the_coarse_stage_may_see_the_first_times_only() {
        let frames = frames(3, 5);
        for sampling in [Sampling::Shuffled, Sampling::SameTime] {
            let mut sampler = sampler(sampling, 2, Some(2), &frames);
            let mut latest = |stage| {
                let views: Vec<usize> = (1..=40).flat_map(|i| sampler.batch(1, stage, i)).collect();
                views.iter().map(|view| frames[*view].time).fold(0.0, f32::max)
            };
            assert_eq!((latest(Stage::Coarse), latest(Stage::Fine)), (0.2, 0.8));
        }
    }

    #[test]
    fn a_resumed_run_draws_the_same_frames() {
        let frames = frames(3, 7);
        for sampling in [Sampling::Shuffled, Sampling::SameTime] {
            let mut whole = sampler(sampling, 2, None, &frames);
            let all: Vec<_> = (1..=60).map(|i| whole.batch(5, Stage::Fine, i)).collect();
            let mut resumed = sampler(sampling, 2, None, &frames);
            let rest: Vec<_> = (31..=60).map(|i| resumed.batch(5, Stage::Fine, i)).collect();
            assert_eq!(all[30..], rest);
        }
    }
}
