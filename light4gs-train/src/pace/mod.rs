//! The time of a training on this machine, estimated from a dozen iterations of each kind.
//!
//! An iteration becomes slower as Gaussians are added, and slower again when it has a rate. So the run's own scene is
//! trained for a moment, in memory: with the Gaussians of the beginning, then with the most Gaussians at each size of the
//! images, then with the rate. All Gaussians get the sizes of trained ones, since the time depends on these more than on
//! anything else. Only the times are kept.

mod typical_gaussians;

use std::collections::BTreeSet;
use std::time::Instant;

use light4gs_data::Scene;
use light4gs_model::FieldKind;

use crate::config::Config;
use crate::error::TrainError;
use crate::stage::Stage;
use crate::trainer::Trainer;
use crate::trainer::rate_correction::CORRECTIONS;
use typical_gaussians::TypicalGaussians;

/// Iterations of the coarse stage that are measured.
const COARSE: usize = 6;
/// Iterations of the fine stage with the Gaussians of the beginning, and with all at each size of the images.
const PLAIN: usize = 9;
/// Iterations from one with the rate to the next, in the last part of the moment; in the run the rate may be rarer.
const RATE_INTERVAL: usize = 3;
// The last of every `RATE_INTERVAL` iterations after the plain ones has the rate.
const _: () = assert!(PLAIN.is_multiple_of(RATE_INTERVAL));
/// Measured iterations with the rate.
const RATE_ROUNDS: usize = 4;
/// Training views of the moment, spread over all of them: their images are decoded once.
const VIEWS: usize = 12;
/// Rounds of cloning until the most Gaussians are reached, measured on `hypernerf_mini` (iteration 1200, rounds from 200 on,
/// one in 100 iterations).
const ROUNDS: f64 = 10.0;
/// Share of all added Gaussians that a round adds under a squared loss: its small gradients clone few. Measured on *dancer*,
/// *flag*, *bouncing* and *lego* (0.4 to 0.8 in 38 rounds).
const ADDED_UNDER_SQUARES: f64 = 0.016;
/// The same once the squared loss has ended.
const ADDED_AFTER_SQUARES: f64 = 0.2;

/// Seconds of the iterations of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// An iteration of the coarse stage.
    pub coarse: f64,
    /// One of the fine stage, at the beginning.
    pub first: Iteration,
    /// One with the most Gaussians, at each of the run's image sizes; the last is that of whole images.
    pub full: Vec<Iteration>,
    /// Seconds that the rate adds to an iteration after densification: the mean over iterations with and without it.
    pub rate: f64,
    /// The most Gaussians that guided sampling adds at a time.
    pub guided: usize,
}

/// An iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iteration {
    /// Gaussians in it.
    pub gaussians: usize,
    /// Its duration.
    pub seconds: f64,
}

impl Pace {
    /// The most Gaussians that densification leaves.
    fn full_count(&self) -> usize {
        self.full.last().map_or(self.first.gaussians, |iteration| iteration.gaussians)
    }

    /// The most Gaussians of a run of this configuration.
    pub fn most_gaussians(&self, config: &Config) -> usize {
        self.full_count() + self.guided * config.train.guided_sampling.iterations.len()
    }

    /// Trains the scene of a run for a moment.
    ///
    /// # Errors
    /// As [`Trainer`]'s builder, and its steps.
    pub fn measure(config: &Config, mut data: Scene) -> Result<Self, TrainError> {
        let times: BTreeSet<u32> = data.train.iter().map(|frame| frame.time.to_bits()).collect();
        let guided = config.train.guided_sampling.count * times.len();
        let apart = data.train.len().div_ceil(VIEWS).max(1);
        data.train = data.train.into_iter().step_by(apart).collect();
        let density = TypicalGaussians::new(config, &data, PLAIN, plain_iterations(config))?;
        let mut trainer = Trainer::builder(moment_of(config), data).density(density).build()?;
        let (mut coarse, mut fine) = (Vec::new(), Vec::new());
        while fine.len() < fine_iterations(config) {
            let begin = Instant::now();
            let Some(report) = trainer.step()? else { break };
            let seconds = begin.elapsed().as_secs_f64();
            match report.stage {
                Stage::Coarse => coarse.push(seconds),
                Stage::Fine => fine.push(Iteration { gaussians: report.gaussians, seconds }),
            }
        }
        Ok(Self { guided, ..Self::of(config, coarse, &fine) })
    }

    /// From the seconds of the moment's coarse iterations, and from its fine ones. Guided sampling is left at 0.
    fn of(config: &Config, coarse: Vec<f64>, fine: &[Iteration]) -> Self {
        let (first, rest) = fine.split_at(PLAIN);
        let (sizes, rate) = rest.split_at(PLAIN * sizes(config).len());
        // Gaussians are added in the first.
        let full: Vec<_> = sizes.chunks_exact(PLAIN).map(|size| typical(&size[1..])).collect();
        let (with, without): (Vec<_>, Vec<_>) =
            rate.iter().enumerate().partition(|(k, _)| (k + 1) % RATE_INTERVAL == 0);
        let seconds = |iterations: Vec<(usize, &Iteration)>| {
            median(iterations.into_iter().map(|(_, iteration)| iteration.seconds).collect())
        };
        // The seconds of the rate, divided among the iterations of its interval, and those of the noise in each.
        let whole = full.last().expect("whole images are one of the sizes").seconds;
        let noisy = seconds(without);
        let rate = (seconds(with) - noisy) / config.compression.rate.interval as f64 + noisy - whole;
        Self { coarse: median(coarse), first: typical(first), full, rate: rate.max(0.0), guided: 0 }
    }

    /// Seconds that the training of a configuration takes, without coding and measuring. Its image sizes must be those of
    /// the measured configuration.
    pub fn training_seconds(&self, config: &Config) -> f64 {
        let train = &config.train;
        let adaptive = &train.densify.strategies.adaptive;
        let (first, full_count) = (self.first, self.full_count());
        let added = self.full[0].gaussians as f64 - first.gaussians as f64;
        let growth = (self.full[0].seconds - first.seconds) / added.max(1.0);
        let rate = if config.compression.rate.lambda > 0.0 { self.rate } else { 0.0 };
        // Planes have a rate while Gaussians are still added.
        let planes = config.model.field == FieldKind::HexPlane;
        let rate_from =
            if planes { config.compression.rate.from } else { config.compression.rate.from.max(adaptive.until) };

        let end = train.fine_iterations;
        let [from, until] = [adaptive.from, adaptive.until].map(|iteration| iteration.min(end) as f64);
        let squared = (train.losses.photometric.l2_until as f64).min(until);
        let interval = adaptive.interval.max(1) as f64;
        // The share of all Gaussians to be added that is there at an iteration.
        let reached = |iteration: f64| {
            let rounds = |since: f64, until: f64| ((iteration.min(until) - since) / interval).max(0.0);
            let reached = match squared > from {
                false => rounds(from, until) / ROUNDS,
                true => rounds(from, squared) * ADDED_UNDER_SQUARES + rounds(squared, until) * ADDED_AFTER_SQUARES,
            };
            reached.min(1.0)
        };
        let prunings: Vec<f64> = match train.prune.fraction > 0.0 {
            true => train.prune.iterations.iter().map(|&iteration| iteration as f64).collect(),
            false => Vec::new(),
        };
        let guided = &train.guided_sampling.iterations;
        let sizes = sizes(config);
        let seconds_at = |progress: f64| {
            let iteration = progress * end as f64;
            let passes = prunings.iter().filter(|&&pass| pass < iteration).count();
            let size = sizes.iter().take_while(|until| progress >= **until).count();
            let full = self.full[size];
            let grown = first.gaussians as f64 + (full_count as f64 - first.gaussians as f64) * reached(iteration);
            let sampled = self.guided * guided.iter().filter(|&&time| (time as f64) < iteration).count();
            let added = grown.min(full.gaussians as f64) + sampled as f64;
            let count = added * (1.0 - train.prune.fraction).powi(passes as i32);
            let plain = (full.seconds + growth * (count - full.gaussians as f64)).max(0.0);
            if iteration >= rate_from as f64 { plain + rate * count / full_count.max(1) as f64 } else { plain }
        };
        // A thousand samples are exact enough.
        let samples = end.clamp(1, 1000);
        let fine: f64 = (0..samples).map(|sample| seconds_at((sample as f64 + 0.5) / samples as f64)).sum();
        fine * end as f64 / samples as f64 + train.coarse_iterations as f64 * self.coarse
    }
}

/// The sizes of a run's images: the share of the fine stage until which it has each, in the order of the run.
fn sizes(config: &Config) -> Vec<f64> {
    let coarse_to_fine = &config.train.coarse_to_fine;
    let mut sizes = vec![coarse_to_fine.quarter_until, coarse_to_fine.half_until, 1.0];
    sizes.retain(|until| *until > 0.0);
    sizes
}

/// Iterations of the moment's fine stage before those with a rate: some with the Gaussians of the beginning, and some with
/// all at each size of the images.
fn plain_iterations(config: &Config) -> usize {
    PLAIN * (1 + sizes(config).len())
}

/// Iterations of the fine stage that are measured.
fn fine_iterations(config: &Config) -> usize {
    plain_iterations(config) + RATE_ROUNDS * RATE_INTERVAL
}

/// The configuration of the measured moment: the beginning of a training that is so long that the expected bits are not
/// corrected yet. A correction takes longer than an iteration, and a run has only a dozen.
fn moment_of(config: &Config) -> Config {
    let mut moment = config.clone();
    let train = &mut moment.train;
    train.coarse_iterations = COARSE;
    let plain = plain_iterations(config);
    train.fine_iterations = CORRECTIONS * (fine_iterations(config) + 1);
    let coarse_to_fine = &mut train.coarse_to_fine;
    let mut until = PLAIN;
    for share in [&mut coarse_to_fine.quarter_until, &mut coarse_to_fine.half_until] {
        if *share > 0.0 {
            until += PLAIN;
            *share = until as f64 / train.fine_iterations as f64;
        }
    }
    train.sh_degree_interval = 1;
    train.prune.fraction = 0.0;
    train.guided_sampling.iterations = Vec::new();
    moment.compression.rate.from = plain;
    moment.compression.rate.interval = RATE_INTERVAL;
    moment.compression.rate.planes_until = 0;
    // To steer the rate, the scene would be coded every few iterations.
    (moment.compression.target_bytes, moment.compression.target_db) = (0, 0.0);
    moment.eval.interval = 0;
    moment
}

/// The last number of Gaussians, and the median of the times.
fn typical(iterations: &[Iteration]) -> Iteration {
    let gaussians = iterations.last().map_or(0, |iteration| iteration.gaussians);
    Iteration { gaussians, seconds: median(iterations.iter().map(|iteration| iteration.seconds).collect()) }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::density::AdaptiveDensityConfig;
    use crate::trainer::rate_correction::is_due;

    #[test]
    fn the_rate_is_what_it_adds_to_an_iteration() {
        let config = Config::load("dnerf", &["compression.rate.interval=5".to_owned()]).unwrap();
        let iteration = |gaussians: usize, seconds: f64| Iteration { gaussians, seconds };
        let mut fine = vec![iteration(1000, 1.0); PLAIN];
        for _ in sizes(&config) {
            // The first one adds Gaussians.
            fine.push(iteration(9000, 70.0));
            fine.extend(vec![iteration(9000, 2.0); PLAIN - 1]);
        }
        for k in 0..RATE_ROUNDS * RATE_INTERVAL {
            fine.push(iteration(9000, if (k + 1) % RATE_INTERVAL == 0 { 7.0 } else { 4.0 }));
        }
        let pace = Pace::of(&config, vec![0.5; COARSE], &fine);
        assert_eq!((pace.coarse, pace.first, pace.full_count()), (0.5, iteration(1000, 1.0), 9000));
        assert!(pace.full.iter().all(|full| full.seconds == 2.0));
        // Three more than noise alone, once in five iterations, and two that the noise takes.
        assert!((pace.rate - 2.6).abs() < 1e-9, "{}", pace.rate);
    }

    #[test]
    fn expected_bits_are_not_corrected_while_it_is_measured() {
        for preset in ["dnerf", "neu3d", "hypernerf+medium"] {
            let config = Config::load(preset, &[]).unwrap();
            let moment = moment_of(&config).train.fine_iterations;
            assert!(!(1..=fine_iterations(&config)).any(|iteration| is_due(iteration, moment)), "{preset}");
        }
    }

    #[test]
    fn gaussians_come_late_under_a_squared_loss() {
        let full = Iteration { gaussians: 10_000, seconds: 10.0 };
        let first = Iteration { gaussians: 1000, seconds: 1.0 };
        let seconds = |overrides: &[&str]| {
            let common = ["train.prune.fraction=0", "compression.rate.lambda=0", "train.coarse_iterations=0"];
            let overrides: Vec<String> = common.iter().chain(overrides).map(|key| (*key).to_owned()).collect();
            let config = Config::load("dnerf", &overrides).unwrap();
            let adaptive = &config.train.densify.strategies.adaptive;
            let AdaptiveDensityConfig { from, until, interval, .. } = *adaptive;
            assert_eq!((from, until, interval, config.train.fine_iterations), (200, 5000, 100, 12_000));
            let pace = Pace { coarse: 0.0, first, full: vec![full; sizes(&config).len()], rate: 0.0, guided: 0 };
            pace.training_seconds(&config)
        };
        // A second for a thousand Gaussians: 1000 of them, then as many as there are in the mean while they are added, then all.
        let at_once = 200.0 + 1000.0 * 5.5 + 10_800.0 * 10.0;
        let late = 200.0 + 3800.0 * 3.736 + 196.0 * 8.236 + 7804.0 * 10.0;
        for (until, expected) in [(0, at_once), (4000, late)] {
            let found = seconds(&[&format!("train.photometric.l2_until={until}")]);
            assert!((found / expected - 1.0).abs() < 1e-3, "until {until}: {found}, expected {expected}");
        }
    }

    #[test]
    fn guided_sampling_adds_gaussians_beyond_those_of_densification() {
        let full = Iteration { gaussians: 10_000, seconds: 10.0 };
        let first = Iteration { gaussians: 1000, seconds: 1.0 };
        let keys = [
            "train.prune.fraction=0",
            "compression.rate.lambda=0",
            "train.coarse_iterations=0",
            "train.guided_sampling.iterations=[6000, 9000]",
            "train.photometric.l2_until=0",
            "model.nodes.lifetime=true",
        ];
        let config = Config::load("dnerf", &keys.map(str::to_owned)).unwrap();
        let of = |guided| Pace { coarse: 0.0, first, full: vec![full; sizes(&config).len()], rate: 0.0, guided };
        assert_eq!((of(0).most_gaussians(&config), of(500).most_gaussians(&config)), (10_000, 11_000));
        // Half a second for 500 Gaussians: in 6000 iterations, and once more in 3000.
        let more = of(500).training_seconds(&config) - of(0).training_seconds(&config);
        assert!((more / (0.5 * 9000.0) - 1.0).abs() < 1e-3, "{more}");
    }
}
