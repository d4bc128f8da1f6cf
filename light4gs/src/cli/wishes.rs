//! `--pixels`, `--minutes`, `--target-bytes` and `--target-db`: what a user wishes, as changes of the configuration.

use std::path::Path;

use clap::Args;
use light4gs_data::{Camera, Scene};
use light4gs_train::config::{Config, Overrides};
use light4gs_train::dataset::load_options;
use light4gs_train::error::TrainError;
use light4gs_train::pace::Pace;

use super::output::tell;

/// Shorter trainings are not worth an estimate.
const FEWEST_ESTIMATED: usize = 1000;
/// No schedule is made shorter than this share of its preset's: nothing could be seen in such a scene.
const SHORTEST: f64 = 0.05;
/// No schedule is made longer than this: the quality has long stopped growing.
const LONGEST: f64 = 50.0;

#[derive(Debug, Args)]
pub(super) struct Wishes {
    /// Train on images whose longer side has this many pixels; smaller ones stay as they are. The number of Gaussians
    /// follows.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(8..=16_384))]
    pixels: Option<u32>,
    /// Train for about this long on this machine, whose speed is measured before the start. The number of iterations
    /// follows.
    #[arg(long, value_name = "NUMBER", value_parser = minutes)]
    minutes: Option<f64>,
    /// The file shall have at most so many bytes, such as 300k or 2M, and hardly fewer. How many Gaussians stay, and what a
    /// byte weighs in the loss, follow.
    #[arg(long, value_name = "NUMBER", value_parser = bytes)]
    target_bytes: Option<usize>,
    /// The decoded file shall have at least this PSNR on the test views, dB, and hardly more. What a byte weighs in the loss
    /// follows, in the last part of training.
    #[arg(long, value_name = "NUMBER", value_parser = decibels, conflicts_with = "target_bytes")]
    target_db: Option<f64>,
}

impl Wishes {
    /// The configuration that presets, wishes and overrides give; the overrides win. Where the preset is `automatic`,
    /// the number of Gaussians follows the images even without a wish. Says how long the training will take, unless it
    /// is short or `quiet`.
    pub(super) fn config(
        &self,
        preset: &str,
        overrides: &[String],
        scene: &Path,
        automatic: bool,
        quiet: bool,
    ) -> Result<Config, TrainError> {
        let mut config = Config::load(preset, overrides)?;
        let by_hand = Overrides::parse(overrides)?;
        if let Some(pixels) = self.pixels.or(config.data.resolution.filter(|_| automatic)) {
            // Without overrides, which may name a number of Gaussians that is meant for this size.
            let presets = Config::load(preset, &[])?;
            let longest = longest_side(&Scene::open(scene, &load_options(&config))?);
            config = presets.for_pixels(pixels, longest).with(&by_hand)?;
        }
        if let Some(bytes) = self.target_bytes {
            config = config.for_target_bytes(bytes, &by_hand);
        }
        if let Some(quality) = self.target_db {
            config = config.for_target_db(quality, &by_hand);
        }
        config.validate()?;
        let estimated = !quiet && config.train.coarse_iterations + config.train.fine_iterations >= FEWEST_ESTIMATED;
        if self.minutes.is_none() && !estimated {
            return Ok(config);
        }

        let data = Scene::open(scene, &load_options(&config))?;
        let camera = data.train.first().map(|frame| frame.camera);
        let pace = Pace::measure(&config, data)?;
        if let Some(minutes) = self.minutes {
            config = in_minutes(minutes, &pace, |factor| config.for_schedule(factor, &by_hand))?;
            config.validate()?;
        }
        if !quiet && let Some(camera) = camera {
            announce(&config, &camera, &pace);
        }
        Ok(config)
    }
}

/// The longer side of the largest training image in its file, pixels.
fn longest_side(data: &Scene) -> u32 {
    data.train.iter().map(|frame| frame.source_width.max(frame.source_height)).max().unwrap_or(0).max(1)
}

/// Of the schedules that `scaled` gives for a factor, the one whose training takes this many minutes.
fn in_minutes(minutes: f64, pace: &Pace, scaled: impl Fn(f64) -> Config) -> Result<Config, TrainError> {
    let minutes_of = |factor: f64| pace.training_seconds(&scaled(factor)) / 60.0;
    let [least, most] = [SHORTEST, LONGEST].map(minutes_of);
    if !(least..=most).contains(&minutes) {
        return Err(TrainError::Input(format!(
            "--minutes {minutes}: this scene takes {least:.1} to {most:.0} minutes on this machine; give a number \
             between them, or another --pixels"
        )));
    }
    // Not in proportion: in a short schedule there is no time for as many Gaussians. So it is bisected, in the
    // logarithm, until the factor is known to a thousandth.
    let [mut below, mut above] = [SHORTEST, LONGEST];
    while above / below > 1.001 {
        let middle = (below * above).sqrt();
        if minutes_of(middle) < minutes {
            below = middle;
        } else {
            above = middle;
        }
    }
    Ok(scaled(below))
}

/// Says how large the training is and how long it will take.
fn announce(config: &Config, camera: &Camera, pace: &Pace) {
    tell(format_args!(
        "{}×{} pixels, at most {} Gaussians, {} + {} iterations: about {:.1} minutes of training on this machine",
        camera.width,
        camera.height,
        pace.most_gaussians(config),
        config.train.coarse_iterations,
        config.train.fine_iterations,
        pace.training_seconds(config) / 60.0
    ));
}

/// A number of bytes, with `k` for thousands or `M` for millions.
pub(super) fn bytes(text: &str) -> Result<usize, String> {
    let (digits, unit) = match text.strip_suffix(['k', 'K']) {
        Some(digits) => (digits, 1e3),
        None => text.strip_suffix('M').map_or((text, 1.0), |digits| (digits, 1e6)),
    };
    match digits.parse::<f64>().map(|number| (number * unit).round()) {
        Ok(bytes) if (1e3..=1e12).contains(&bytes) => Ok(bytes as usize),
        _ => Err("expected bytes, from 1000 to 10^12, such as 300000, 300k or 2.5M".to_owned()),
    }
}

/// A PSNR in dB.
pub(super) fn decibels(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(quality) if (1.0..=100.0).contains(&quality) => Ok(quality),
        _ => Err("expected a PSNR in dB, from 1 to 100, such as 28.5".to_owned()),
    }
}

fn minutes(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(minutes) if (0.01..=100_000.0).contains(&minutes) => Ok(minutes),
        _ => Err("expected minutes, from 0.01 to 100000".to_owned()),
    }
}
