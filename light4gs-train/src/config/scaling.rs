//! A configuration for other images, another length of training or a file of a certain size: methods that change its
//! values.
//!
//! Keys that a user sets by hand win. So either the overrides are laid over the result, or the method gets them and leaves
//! their keys alone.

use super::{Config, Overrides};
use crate::density::gaussians_for_images;

/// Bytes of a file that its motion takes, and those of each Gaussian of it (docs/notebook/2026-11-29-d-nerf.md).
const BYTES_OF_MOTION: f64 = 8e3;
const BYTES_A_GAUSSIAN: f64 = 8.3;
/// The cap on Gaussians is at most this number of times the preset's: a training takes longer with more of them.
const MOST_GROWTH: f64 = 2.0;
/// Bytes at which the formulas below have their first number; `r` is a file's size in these bytes (docs/results.md, sizes).
const REFERENCE_BYTES: f64 = 64e3;
/// Weight of a megabyte of attributes in the loss: the first number times `r` to the power of the second.
const MEGABYTE: (f64, f64) = (0.03, -2.0);
/// Share of the Gaussians that a pass of pruning drops: the first number plus the second times `ln r`, within the bounds.
const PRUNED: (f64, f64) = (0.3, -0.17);
const PRUNED_BOUNDS: [f64; 2] = [0.1, 0.6];
/// Fewer Gaussians than this show no scene, however small its file.
const FEWEST: f64 = 1000.0;

impl Config {
    /// For images whose longer side has `pixels` pixels: changes the resolution and the numbers of Gaussians. `longest` is
    /// the longer side of the images in their files; they are never enlarged.
    ///
    /// The numbers of Gaussians must fit this configuration's resolution. So it must not contain a user's overrides yet;
    /// [`Config::with`] lays them over the result.
    pub fn for_pixels(&self, pixels: u32, longest: u32) -> Self {
        let mut config = self.clone();
        let before = f64::from(self.data.resolution.unwrap_or(longest));
        let ratio = f64::from(pixels.min(longest)) / before;
        config.data.resolution = Some(pixels);
        let Self { train, .. } = &mut config;
        for count in [&mut train.densify.strategies.adaptive.max_gaussians, &mut train.guided_sampling.count] {
            *count = gaussians_for_images(*count, ratio);
        }
        config
    }

    /// For a file of at most `bytes`: sets the target, the cap on Gaussians, the share of them that is pruned, and the initial weight
    /// of a byte, which the trainer corrects as it goes. Keys that are set `by_hand` stay as they are.
    pub fn for_target_bytes(&self, bytes: usize, by_hand: &Overrides) -> Self {
        let mut config = self.with_a_rate(by_hand);
        let Self { train, compression, .. } = &mut config;
        by_hand.unless_set("compression.target_bytes", &mut compression.target_bytes, bytes);
        if compression.rate.attributes {
            let bytes = bytes as f64;
            let ratio = bytes / REFERENCE_BYTES;
            let weight = (MEGABYTE.0 * ratio.powf(MEGABYTE.1)).clamp(1e-4, 1.0);
            let lambda = &mut compression.rate.attribute_lambda;
            by_hand.unless_set("compression.rate.attribute_lambda", lambda, rounded(weight, 1e5));
            let [least, largest] = PRUNED_BOUNDS;
            let pruned = (PRUNED.0 + PRUNED.1 * ratio.ln()).clamp(least, largest);
            // In a short schedule of the user's, the iterations of pruning may lie behind its end. They are legal there only
            // as long as pruning is off.
            if train.prune.iterations.iter().all(|pass| *pass <= train.fine_iterations) {
                by_hand.unless_set("train.prune.fraction", &mut train.prune.fraction, rounded(pruned, 1e3));
            }
            let kept = (1.0 - train.prune.fraction.min(largest)).powi(train.prune.iterations.len() as i32);
            let most = &mut train.densify.strategies.adaptive.max_gaussians;
            let before = *most as f64;
            let cap =
                ((bytes - BYTES_OF_MOTION) / BYTES_A_GAUSSIAN / kept).clamp(FEWEST.min(before), MOST_GROWTH * before);
            by_hand.unless_set("train.densify.adaptive.max_gaussians", most, cap.round() as usize);
        }
        config
    }

    /// For a file with this PSNR on the test views, dB. The trainer corrects the weight of the rate as it goes. Keys that
    /// are set `by_hand` stay as they are.
    pub fn for_target_db(&self, quality: f64, by_hand: &Overrides) -> Self {
        let mut config = self.with_a_rate(by_hand);
        by_hand.unless_set("compression.target_db", &mut config.compression.target_db, quality);
        config
    }

    /// The configuration with a rate in the loss: a wish needs its weight.
    fn with_a_rate(&self, by_hand: &Overrides) -> Self {
        let mut config = self.clone();
        let lambda = &mut config.compression.rate.lambda;
        if *lambda <= 0.0 {
            by_hand.unless_set("compression.rate.lambda", lambda, 0.007);
        }
        config
    }

    /// The same schedule `factor` times as long: every key that counts iterations of a stage. 0 stays 0, "never". Keys
    /// that are set `by_hand` stay as they are.
    pub fn for_schedule(&self, factor: f64, by_hand: &Overrides) -> Self {
        let scaled = |iterations: usize| match iterations {
            0 => 0,
            _ => ((iterations as f64 * factor).round() as usize).max(1),
        };
        // Pruning stays after densification, whatever is rounded.
        let after = scaled(self.train.densify.chosen().end()) + 1;
        let mut config = self.clone();
        for (key, iterations) in config.schedule() {
            let longer = scaled(*iterations);
            by_hand.unless_set(key, iterations, longer);
        }
        let Self { train, .. } = &mut config;
        let passes = train.prune.iterations.iter().map(|&pass| scaled(pass).max(after)).collect();
        by_hand.unless_set("train.prune.iterations", &mut train.prune.iterations, passes);
        let guided = train.guided_sampling.iterations.iter().map(|&pass| scaled(pass)).collect();
        by_hand.unless_set("train.guided_sampling.iterations", &mut train.guided_sampling.iterations, guided);
        let steps = train.learning_rate.schedule_steps.map(scaled);
        by_hand.unless_set("train.learning_rate.schedule_steps", &mut train.learning_rate.schedule_steps, steps);
        config
    }

    /// The keys that count iterations of a stage, with their values.
    fn schedule(&mut self) -> [(&'static str, &mut usize); 11] {
        let Self { train, compression, .. } = self;
        let adaptive = &mut train.densify.strategies.adaptive;
        [
            ("train.coarse_iterations", &mut train.coarse_iterations),
            ("train.fine_iterations", &mut train.fine_iterations),
            ("train.sh_degree_interval", &mut train.sh_degree_interval),
            ("train.photometric.l2_until", &mut train.losses.photometric.l2_until),
            ("train.densify.adaptive.from", &mut adaptive.from),
            ("train.densify.adaptive.until", &mut adaptive.until),
            ("train.densify.adaptive.prune_from", &mut adaptive.prune_from),
            ("train.densify.adaptive.opacity_reset_interval", &mut adaptive.opacity_reset_interval),
            ("compression.rate.from", &mut compression.rate.from),
            ("compression.rate.planes_until", &mut compression.rate.planes_until),
            ("compression.steps.adaptive_from", &mut compression.steps.adaptive_from),
        ]
    }
}

/// A multiple of a fraction, as a person would write it.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}

impl Overrides {
    /// Sets a value, unless its key is set by hand.
    fn unless_set<T>(&self, key: &str, place: &mut T, value: T) {
        if !self.has(key) {
            *place = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{KEYS, preset_names};

    #[test]
    fn a_schedule_of_the_same_length_changes_nothing() {
        for preset in ["hypernerf", "nerfds", "dnerf+medium", "hexplane-dnerf", "quickstart"] {
            let config = Config::load(preset, &[]).unwrap();
            assert_eq!(config.for_schedule(1.0, &Overrides::default()), config, "{preset}");
        }
    }

    /// A legal configuration stays legal at every length: pruning after densification, cloning after it has begun.
    #[test]
    fn every_preset_can_be_longer_and_shorter() {
        for preset in preset_names() {
            let Ok(config) = Config::load(preset, &[]) else { continue };
            for factor in [0.01, 0.33, 7.1] {
                let longer = config.for_schedule(factor, &Overrides::default());
                longer.validate().unwrap();
                let expected = (config.train.fine_iterations as f64 * factor).round() as usize;
                assert_eq!(longer.train.fine_iterations, expected, "{preset}");
            }
        }
    }

    #[test]
    fn gaussians_follow_the_images() {
        let config = Config::load("hypernerf", &["data.resolution=200".into()]).unwrap();
        let most = |pixels, longest| {
            let config = config.for_pixels(pixels, longest);
            config.validate().unwrap();
            (config.data.resolution, config.train.densify.strategies.adaptive.max_gaussians)
        };
        let before = config.train.densify.strategies.adaptive.max_gaussians;
        assert_eq!(most(200, 480), (Some(200), before));
        assert_eq!(most(400, 480), (Some(400), (before as f64 * 2f64.powf(1.4)).round() as usize));
        // Smaller images stay as they are.
        assert_eq!(most(960, 400), (Some(960), most(400, 400).1));
    }

    /// At the reference, its values; with fewer bytes fewer Gaussians and a dearer byte, within bounds.
    #[test]
    fn fewer_bytes_are_fewer_gaussians_and_a_dearer_byte() {
        let config = Config::load("dnerf", &[]).unwrap();
        let at = |bytes| {
            let config = config.for_target_bytes(bytes, &Overrides::default());
            config.validate().unwrap();
            assert_eq!(config.compression.target_bytes, bytes);
            assert!(config.compression.rate.lambda > 0.0);
            let most = config.train.densify.strategies.adaptive.max_gaussians;
            (config.train.prune.fraction, config.compression.rate.attribute_lambda, most)
        };
        let most = config.train.densify.strategies.adaptive.max_gaussians;
        // Two passes of pruning leave (64 000 - 8000) / 8.3 Gaussians.
        assert_eq!(at(64_000), (0.3, 0.03, 13_769));
        let (fraction, lambda, fewer) = at(40_000);
        assert!(fraction > 0.3 && lambda > 0.06 && fewer < 13_769, "{fraction}, {lambda}, {fewer}");
        assert_eq!(at(1000), (0.6, 1.0, 1000));
        assert_eq!(at(1_000_000_000), (0.1, 1e-4, 2 * most));
    }

    #[test]
    fn what_is_set_by_hand_wins() {
        let preset = Config::load("hypernerf", &[]).unwrap();
        let by_hand = ["train.fine_iterations=10000", "train = { densify = { adaptive = { max_gaussians = 70 } } }"];
        let by_hand = Overrides::parse(&by_hand.map(str::to_owned)).unwrap();
        let changed = preset.for_pixels(960, 960).with(&by_hand).unwrap().for_schedule(2.0, &by_hand);
        assert_eq!(changed.train.fine_iterations, 10000);
        assert_eq!(changed.train.densify.strategies.adaptive.max_gaussians, 70);
        assert_eq!(changed.train.coarse_iterations, 2 * preset.train.coarse_iterations);
        assert_eq!(changed.data.resolution, Some(960));
    }

    /// The keys' names are those of the values, and a wish leaves each alone that is set by hand.
    #[test]
    fn every_key_that_a_wish_changes_can_be_set_by_hand() {
        let presets = "hypernerf+medium";
        let free = Overrides::default();
        let wished = |config: &Config, by_hand: &Overrides| {
            let config = config.for_target_bytes(20_000, by_hand).for_schedule(3.0, by_hand);
            config.for_target_db(25.0, by_hand)
        };
        let values = |config: &Config| {
            let table = toml::Value::try_from(config).unwrap();
            let value = |path: &str| path.split('.').fold(&table, |table, name| &table[name]).clone();
            KEYS.iter().map(|key| (key.path.clone(), value(&key.path))).collect::<Vec<_>>()
        };
        let preset = Config::load(presets, &["compression.rate.lambda=0".to_owned()]).unwrap();
        let changed = values(&wished(&preset, &free));
        let changed: Vec<_> =
            values(&preset).into_iter().zip(changed).filter(|(before, after)| before != after).collect();
        assert!(changed.len() > 10, "{changed:?}");
        for ((key, before), _) in changed {
            let by_hand = Overrides::parse(&[format!("{key}={before}")]).unwrap();
            let kept = values(&wished(&preset, &by_hand));
            assert!(kept.contains(&(key.clone(), before)), "{key}");
        }
    }
}
