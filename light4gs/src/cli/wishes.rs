//! `--pixels`, `--minutes`, `--target-bytes` and `--target-db`: wishes of a user, as changes of the configuration.

use std::path::Path;

use clap::Args;
use light4gs_data::{Camera, Scene, turn_between_frames};
use light4gs_model::FieldKind;
use light4gs_train::compression::CodingRecord;
use light4gs_train::config::{Config, Overrides};
use light4gs_train::dataset::load_options;
use light4gs_train::error::TrainError;
use light4gs_train::pace::Pace;
use light4gs_train::take::{SEGMENT_SHARE, TakePlan};

use super::output::tell;

/// The preset on top of a layout's for sharp images of what is seen from all around.
const THOROUGH: &str = "thorough";
/// It is laid there from this size of the images on, pixels of the shorter side...
const THOROUGH_FROM: u32 = 400;
/// ...if the camera turns by more than this from one frame to the next: a video turns by a few degrees. Degrees.
const JUMP: f32 = 20.0;
/// Shorter trainings are not worth an estimate.
const FEWEST_ESTIMATED: usize = 1000;
/// No schedule is made shorter than this share of its preset's: nothing could be seen in such a scene.
const SHORTEST: f64 = 0.05;
/// No schedule is made longer than this: the quality has long stopped growing.
const LONGEST: f64 = 50.0;

#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Wishes {
    /// Pixels of the longer side of the training images; smaller images are not enlarged. This option also adapts the
    /// number of Gaussians.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(8..=16_384))]
    pixels: Option<u32>,
    /// Minutes of training on this machine, approximately. This option adapts the number of iterations to the speed of
    /// the machine, which is measured before the start.
    #[arg(long, value_name = "NUMBER", value_parser = minutes)]
    minutes: Option<f64>,
    /// Upper bound of the file's size in bytes, such as 300k or 2M; the size comes close to this bound. This option
    /// adapts the number of Gaussians, and the weight of a byte in the loss.
    #[arg(long, value_name = "NUMBER", value_parser = bytes)]
    target_bytes: Option<usize>,
    /// Lower bound of the PSNR of the decoded file on the test views, dB; the PSNR comes close to this bound. In the
    /// last part of training, this option adapts the weight of a byte in the loss. A run that misses the bound is kept,
    /// and the exit code is 2.
    #[arg(long, value_name = "NUMBER", value_parser = decibels, conflicts_with = "target_bytes")]
    target_db: Option<f64>,
}

impl Wishes {
    /// The configuration that presets, wishes and overrides give; the overrides win. Where the preset is `automatic`,
    /// the number of Gaussians follows the images even without a wish. Says how long the training will take, unless it
    /// is short or `quiet`.
    ///
    /// # Errors
    /// A configuration or a dataset that cannot be used; a wish that cannot be met.
    pub(super) fn config(
        &self,
        preset: &str,
        overrides: &[String],
        scene: &Path,
        automatic: bool,
        quiet: bool,
    ) -> Result<Config, TrainError> {
        let config = Config::load(preset, overrides)?;
        let by_hand = Overrides::parse(overrides)?;
        let config = self.sized(config, preset, &by_hand, scene, automatic)?;
        let config = self.targeted(config, &by_hand)?;
        self.timed(config, &by_hand, |config| Ok(Scene::open(scene, &load_options(config))?), 1.0, quiet)
    }

    /// The same for a take: the time is that of all its parts, with `machines` of them at work, and the target is that of its
    /// file. Nothing is announced.
    ///
    /// # Errors
    /// As [`Wishes::config`].
    pub(super) fn config_of_take(
        &self,
        preset: &str,
        overrides: &[String],
        scene: &Path,
        automatic: bool,
        plan: &TakePlan,
        machines: u32,
    ) -> Result<Config, TrainError> {
        let config = Config::load(preset, overrides)?;
        let by_hand = Overrides::parse(overrides)?;
        let config = self.sized(config, preset, &by_hand, scene, automatic)?;
        // The configuration is that of a clip, of which a segment has a share of the Gaussians, and so of the bytes. The target is
        // that of the whole.
        let segments = plan.segments.len() as f64 * SEGMENT_SHARE;
        let of_clip = |bytes: usize| (bytes as f64 * (1.0 - plan.base_share()) / segments) as usize;
        let part = Self { target_bytes: self.target_bytes.map(of_clip), ..*self };
        let mut config = part.targeted(config, &by_hand)?;
        if let Some(bytes) = self.target_bytes
            && !by_hand.has("compression.target_bytes")
        {
            config.compression.target_bytes = bytes;
        }
        let [from, to] = plan.between(&plan.segments[0]);
        let data = |config: &Config| Ok(Scene::open(scene, &load_options(config))?.between(from, to)?);
        part.timed(config, &by_hand, data, plan.clips() / f64::from(machines), true)
    }

    /// The preset of a layout, with `thorough` on top where the scene gains by it: sharp images, and a camera that jumps from
    /// frame to frame, so that each moment is seen from one side and each side at some moment. Says so.
    ///
    /// # Errors
    /// A configuration or a dataset that cannot be used.
    pub(super) fn preset_for(&self, preset: String, overrides: &[String], scene: &Path) -> Result<String, TrainError> {
        let config = Config::load(&preset, overrides)?;
        let data = Scene::open(scene, &load_options(&config))?;
        let longest = longest_side(&data);
        let shorter = data.train.iter().map(|frame| frame.source_width.min(frame.source_height)).max().unwrap_or(0);
        let pixels = self.pixels.or(config.data.resolution).unwrap_or(longest).min(longest);
        let side = u64::from(shorter) * u64::from(pixels) / u64::from(longest);
        let jumps = turn_between_frames(&data.train) > JUMP;
        if side < u64::from(THOROUGH_FROM) || !jumps || config.model.field != FieldKind::Nodes {
            return Ok(preset);
        }
        tell(format_args!(
            "preset: {preset}+{THOROUGH}, since the camera jumps from frame to frame and the images are large; --config {preset} \
             takes less than half the time"
        ));
        Ok(format!("{preset}+{THOROUGH}"))
    }

    /// The configuration for the wished size of the images.
    fn sized(
        &self,
        config: Config,
        preset: &str,
        by_hand: &Overrides,
        scene: &Path,
        automatic: bool,
    ) -> Result<Config, TrainError> {
        let Some(pixels) = self.pixels.or(config.data.resolution.filter(|_| automatic)) else { return Ok(config) };
        // Without overrides, which may name a number of Gaussians that is meant for this size.
        let presets = Config::load(preset, &[])?;
        let longest = longest_side(&Scene::open(scene, &load_options(&config))?);
        Ok(presets.for_pixels(pixels, longest).with(by_hand)?)
    }

    /// The configuration for the wished size or quality of the file, validated.
    fn targeted(&self, mut config: Config, by_hand: &Overrides) -> Result<Config, TrainError> {
        if let Some(bytes) = self.target_bytes {
            config = config.for_target_bytes(bytes, by_hand);
        }
        if let Some(quality) = self.target_db {
            config = config.for_target_db(quality, by_hand);
        }
        config.validate()?;
        Ok(config)
    }

    /// The configuration for the wished length of the training of `scenes` scenes like that of `data`. Measures this machine if
    /// the length is wished, or is to be announced.
    fn timed(
        &self,
        mut config: Config,
        by_hand: &Overrides,
        data: impl FnOnce(&Config) -> Result<Scene, TrainError>,
        scenes: f64,
        quiet: bool,
    ) -> Result<Config, TrainError> {
        let estimated = !quiet && config.train.coarse_iterations + config.train.fine_iterations >= FEWEST_ESTIMATED;
        if self.minutes.is_none() && !estimated {
            return Ok(config);
        }
        let data = data(&config)?;
        let camera = data.train.first().map(|frame| frame.camera);
        let pace = Pace::measure(&config, data)?;
        if let Some(minutes) = self.minutes {
            config = in_minutes(minutes, scenes, &pace, |factor| config.for_schedule(factor, by_hand))?;
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

/// The schedule with which the training of `scenes` scenes takes this many minutes; `scaled` gives the configuration with a schedule `factor` times as
/// long.
///
/// # Errors
/// [`TrainError::Input`] if even the shortest schedule takes longer, or the longest one less.
fn in_minutes(minutes: f64, scenes: f64, pace: &Pace, scaled: impl Fn(f64) -> Config) -> Result<Config, TrainError> {
    let minutes_of = |factor: f64| scenes * pace.training_seconds(&scaled(factor)) / 60.0;
    let [least, most] = [SHORTEST, LONGEST].map(minutes_of);
    if minutes < least {
        return Err(TrainError::Input(format!(
            "--minutes {minutes}: even the shortest training of this scene takes about {least:.1} minutes on this machine, \
             beside what else runs on it now; give more minutes, or fewer pixels (--pixels)"
        )));
    }
    if minutes > most {
        return Err(TrainError::Input(format!(
            "--minutes {minutes}: even the longest training of this scene takes about {most:.0} minutes on this machine; \
             give fewer minutes"
        )));
    }
    // The time is not proportional to the factor: in a short schedule fewer Gaussians are added. So the logarithm of the
    // factor is bisected, until the factor is known to a thousandth.
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

/// Refuses a finished file that is not as good as was wished. It is kept: with the finest steps, nothing better can be made of
/// this scene.
///
/// # Errors
/// [`TrainError::Input`] with the PSNR that was wished and the one that was reached.
pub(super) fn check_quality(coding: Option<&CodingRecord>, file: &Path) -> Result<(), TrainError> {
    match coding.and_then(|coding| coding.missed_quality) {
        Some(missed) => Err(TrainError::Input(format!("{missed}. This file is kept: {}", file.display()))),
        None => Ok(()),
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
