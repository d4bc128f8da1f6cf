//! How long a training takes on this machine, from a dozen iterations of each kind.
//!
//! An iteration becomes slower as Gaussians are added, and slower again when it has a rate. So the run's own scene is
//! trained for a moment in memory: with the Gaussians of the beginning, with as many as there may be, and with the rate.
//! Nothing of it is kept.

use std::time::Instant;

use light4gs_data::Scene;

use crate::config::{Config, FieldKind};
use crate::error::TrainError;
use crate::stage::Stage;
use crate::trainer::Trainer;

/// Iterations of the coarse stage that are measured.
const COARSE: usize = 6;
/// Iterations of the fine stage with the Gaussians of the beginning, with all, and with the rate.
const PLAIN: usize = 9;
/// Every so many of the last iterations have the rate, however seldom it is due in the run.
const RATE_INTERVAL: usize = 3;
/// So many of them are measured.
const RATE_ROUNDS: usize = 4;
/// Iterations in which the Gaussians may double: enough to multiply them by 4000.
const GROWTH: usize = 12;
/// Training views that are looked at, spread over all of them: their images are decoded once.
const VIEWS: usize = 12;
/// The share of the time between the first and the last cloning after which the most Gaussians are reached, as measured
/// on `hypernerf_mini` (iteration 1200 of 200 to 3600).
const GROWN: f64 = 0.3;

/// Seconds of the iterations of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Gaussians at the beginning.
    pub first_count: usize,
    /// Gaussians after densification.
    pub full_count: usize,
    /// An iteration of the coarse stage.
    pub coarse: f64,
    /// One of the fine stage, at the beginning.
    pub first: f64,
    /// One after densification.
    pub full: f64,
    /// One after densification, in the mean, where every few of them have a rate.
    pub with_rate: f64,
}

impl Pace {
    /// Trains the scene of a run for a moment.
    ///
    /// # Errors
    /// As [`Trainer`]'s builder, and its steps.
    pub fn measure(config: &Config, mut data: Scene) -> Result<Self, TrainError> {
        let apart = data.train.len().div_ceil(VIEWS).max(1);
        data.train = data.train.into_iter().step_by(apart).collect();
        let first_count = data.points.positions.len();
        let mut trainer = Trainer::builder(moment_of(config), data).build()?;
        let (mut coarse, mut fine) = (Vec::new(), Vec::new());
        let mut full_count = first_count;
        loop {
            let begin = Instant::now();
            let Some(report) = trainer.step()? else { break };
            let times = if report.stage == Stage::Coarse { &mut coarse } else { &mut fine };
            times.push(begin.elapsed().as_secs_f64());
            full_count = report.gaussians;
        }
        let (first, full, rate) = (&fine[..PLAIN], &fine[PLAIN + GROWTH..][..PLAIN], &fine[2 * PLAIN + GROWTH..]);
        let rounds: Vec<f64> = rate.chunks_exact(RATE_INTERVAL).map(|round| round.iter().sum()).collect();
        let full = median(full);
        // What one iteration with the rate takes beyond a plain one, spread over those without.
        let more = (median(&rounds) - RATE_INTERVAL as f64 * full) / config.compression.rate.interval as f64;
        Ok(Self {
            first_count,
            full_count,
            coarse: median(&coarse),
            first: median(first),
            full,
            with_rate: full + more.max(0.0),
        })
    }

    /// Seconds that the training of a configuration takes, without coding and measuring.
    pub fn training_seconds(&self, config: &Config) -> f64 {
        let train = &config.train;
        let adaptive = &train.densify.strategies.adaptive;
        let growth = (self.full - self.first) / (self.full_count as f64 - self.first_count as f64).max(1.0);
        let rate = if config.compression.rate.lambda > 0.0 { self.with_rate / self.full } else { 1.0 };
        // Planes have a rate while Gaussians are still added.
        let planes = config.model.field == FieldKind::HexPlane;
        let rate_from =
            if planes { config.compression.rate.from } else { config.compression.rate.from.max(adaptive.until) };

        let end = train.fine_iterations;
        let [from, until] = [adaptive.from, adaptive.until].map(|iteration| iteration.min(end) as f64);
        let grown = from + GROWN * (until - from);
        let prunings: Vec<f64> = match train.prune.fraction > 0.0 {
            true => train.prune.iterations.iter().map(|&iteration| iteration as f64).collect(),
            false => Vec::new(),
        };
        let seconds_at = |iteration: f64| {
            let (first, full) = (self.first_count as f64, self.full_count as f64);
            let reached = ((iteration - from) / (grown - from).max(1.0)).clamp(0.0, 1.0);
            let passes = prunings.iter().filter(|&&pass| pass < iteration).count();
            let count = (first + (full - first) * reached) * (1.0 - train.prune.fraction).powi(passes as i32);
            let plain = (self.first + growth * (count - first)).max(0.0);
            if iteration >= rate_from as f64 { plain * rate } else { plain }
        };
        // A thousand samples say it as well as every iteration.
        let samples = end.clamp(1, 1000);
        let each = end as f64 / samples as f64;
        let fine: f64 = (0..samples).map(|sample| each * seconds_at((sample as f64 + 0.5) * each)).sum();
        fine + train.coarse_iterations as f64 * self.coarse
    }
}

/// The configuration of the moment that is measured.
fn moment_of(config: &Config) -> Config {
    let mut moment = config.clone();
    let train = &mut moment.train;
    train.coarse_iterations = COARSE;
    train.fine_iterations = 2 * PLAIN + GROWTH + RATE_ROUNDS * RATE_INTERVAL;
    train.sh_degree_interval = 1;
    train.prune.fraction = 0.0;
    train.guided_sampling.iterations = Vec::new();
    let adaptive = &mut train.densify.strategies.adaptive;
    (adaptive.from, adaptive.until, adaptive.interval) = (PLAIN, PLAIN + GROWTH, 1);
    let thresholds = [&mut adaptive.grad_threshold_fine_init, &mut adaptive.grad_threshold_fine_final];
    // Every Gaussian that is seen.
    thresholds.into_iter().for_each(|threshold| *threshold = 1e-30);
    adaptive.prune_from = train.fine_iterations;
    adaptive.opacity_reset_interval = 0;
    moment.compression.rate.from = 2 * PLAIN + GROWTH;
    moment.compression.rate.interval = RATE_INTERVAL;
    moment.compression.rate.planes_until = 0;
    moment.eval.interval = 0;
    moment
}

fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}
