//! A window of time that widens: motion is followed outwards from where it is known.

use light4gs_keys::Bounds::Whole;
use light4gs_keys::{SHARE, keys};
use rand::Rng;

use super::{BatchRequest, FrameSampler, Shuffled};
use crate::stage::Stage;

keys! {
    /// Frames of a window of time that widens until it holds all times. The window widens slowly, so even fast objects
    /// move little between the times that are already learned and the new ones. If `survey` is not 0, a survey draws
    /// frames of all times first, so that the field finds the positions of objects. The coarse stage uses the times
    /// with which the fine stage begins.
    pub struct WideningWindow {
        /// Length of the survey, as a share of the fine stage. The survey draws frames of all times, and ends when the
        /// first window begins.
        survey: f64 = 0.0; SHARE, "ours";
        /// The middle of the first window, in the order of all training times: 0 is the first of them, 1 the last.
        center: f64 = 0.5; SHARE, "ours";
        /// Number of different times in the first window.
        times: usize = 12; Whole { least: 1, most: 1_000_000 }, "ours";
        /// A share of the iterations between the survey and the end of the fine stage. Until this share is over, the
        /// first window stays as it is.
        held: f64 = 0.07; SHARE, "ours";
        /// A share of the iterations between the survey and the end of the fine stage. When this share is over, the window
        /// holds all times.
        open: f64 = 0.6; SHARE, "ours";
        /// Share of the drawn frames that have the newest times, while the window widens.
        newest: f64 = 0.3; SHARE, "ours";
        /// Number of times at each end of the window that count as the newest.
        newest_times: usize = 4; Whole { least: 1, most: 1_000_000 }, "ours";
    }
}

impl WideningWindow {
    /// The opening of the window: 0 for the first window, 1 for all times.
    fn share(&self, request: &BatchRequest) -> f64 {
        let done = match request.stage {
            Stage::Coarse => 0.0,
            Stage::Fine => request.iteration as f64 / request.iterations.max(1) as f64,
        };
        if done < self.survey {
            return 1.0;
        }
        let done = (done - self.survey) / (1.0 - self.survey).max(f64::EPSILON);
        if done >= self.open {
            1.0
        } else if done <= self.held {
            0.0
        } else {
            (done - self.held) / (self.open - self.held)
        }
    }

    /// The places of the first and the last time in the window among all times.
    fn places(&self, request: &BatchRequest) -> [usize; 2] {
        let end = request.candidates.times.len() - 1;
        let center = self.center * end as f64;
        let first_half = 0.5 * (self.times as f64 - 1.0);
        let half = first_half + (center.max(end as f64 - center) - first_half).max(0.0) * self.share(request);
        let (first, last) = ((center - half).ceil().max(0.0) as usize, ((center + half).floor() as usize).min(end));
        // A window that lies between two times holds neither: it takes the one before it.
        if first <= last { [first, last] } else { [last, last] }
    }

    /// A time in a window, by its place, while the window widens.
    fn draw(&self, [first, last]: [usize; 2], end: usize, random: &mut impl Rng) -> usize {
        if random.random::<f64>() >= self.newest {
            return random.random_range(first..=last);
        }
        let width = self.newest_times.min(last - first + 1) - 1;
        // A window that has come to one end of time grows at the other only.
        let sides = [(first > 0, first..=first + width), (last < end, last - width..=last)];
        let sides: Vec<_> = sides.into_iter().filter(|(grows, _)| *grows).collect();
        let side = random.random_range(0..sides.len());
        random.random_range(sides[side].1.clone())
    }
}

impl FrameSampler for WideningWindow {
    fn batch(&self, request: &BatchRequest) -> Vec<usize> {
        let times = &request.candidates.times;
        let (window, end) = (self.places(request), times.len() - 1);
        if window == [0, end] {
            return Shuffled {}.batch(request);
        }
        let random = &mut request.generator(request.iteration);
        let view = |_| {
            let frames = &times[self.draw(window, end, random)];
            frames[random.random_range(0..frames.len())]
        };
        (0..request.batch_size).map(view).collect()
    }

    fn window(&self, request: &BatchRequest) -> [f32; 2] {
        let times = &request.candidates.times;
        let [first, last] = self.places(request);
        let at = |place: usize| request.frames[times[place][0]].time;
        // At the ends there is nothing beyond.
        [if first == 0 { 0.0 } else { at(first) }, if last + 1 == times.len() { 1.0 } else { at(last) }]
    }
}

#[cfg(test)]
mod tests {
    use light4gs_data::{Camera, Frame};

    use super::*;
    use crate::sampling::CandidateFrames;

    /// The windows of some iterations of 100, and whether each batch lies within its own.
    fn windows(sampler: &WideningWindow, iterations: &[usize]) -> Vec<[f32; 2]> {
        let camera = Camera::look_at([4.0, 0.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 8, 8);
        // Two cameras, 41 times.
        let frame = |k: usize| Frame::without_image(format!("{k}"), camera, (k % 41) as f32 / 40.0);
        let frames: Vec<Frame> = (0..82).map(frame).collect();
        let candidates = &CandidateFrames::new(&frames);
        let window = |iteration: &usize| {
            let (stage, iteration) = (Stage::Fine, *iteration);
            let request =
                BatchRequest { frames: &frames, candidates, batch_size: 3, stage, iteration, iterations: 100, seed: 1 };
            let [low, high] = sampler.window(&request);
            let batch = sampler.batch(&request);
            assert!(batch.len() == 3 && batch.iter().all(|at| (low..=high).contains(&frames[*at].time)), "{iteration}");
            [low, high]
        };
        iterations.iter().map(window).collect()
    }

    #[test]
    fn the_window_widens_until_it_holds_all() {
        let sampler = WideningWindow { times: 5, ..WideningWindow::default() };
        let all: Vec<usize> = (1..=100).collect();
        let found = windows(&sampler, &all);
        assert_eq!((found[0], found[6]), ([0.45, 0.55], [0.45, 0.55]));
        assert!(found.windows(2).all(|pair| pair[1][0] <= pair[0][0] && pair[1][1] >= pair[0][1]));
        assert!(found[30][0] > 0.1 && found[30][0] < 0.4, "{:?}", found[30]);
        assert_eq!(found[59..], [[0.0, 1.0]; 41]);
    }

    /// All times first, then a window that widens over what is left of the stage.
    #[test]
    fn a_survey_comes_before_the_window() {
        let sampler = WideningWindow { times: 5, survey: 0.5, ..WideningWindow::default() };
        let found = windows(&sampler, &[1, 49, 50, 53, 65, 79, 80]);
        assert_eq!([found[0], found[1]], [[0.0, 1.0]; 2]);
        assert_eq!([found[2], found[3]], [[0.45, 0.55]; 2]);
        assert!(found[4][0] > 0.1 && found[4][0] < 0.4, "{:?}", found[4]);
        assert!(found[5][0] > 0.0 && found[6] == [0.0, 1.0], "{found:?}");
    }

    /// A window that is held for longer than it is closed opens when it has to, and not before.
    #[test]
    fn a_window_may_open_at_once() {
        let sampler = WideningWindow { times: 1, held: 0.8, open: 0.5, center: 0.0, ..WideningWindow::default() };
        assert_eq!(windows(&sampler, &[1, 49, 50]), [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]);
    }
}
