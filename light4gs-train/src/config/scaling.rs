//! A configuration for other images, another length of training or a file of a certain size, as changes of its keys.
//!
//! The changes are overrides as [`Config::load`] takes them, so that what a user sets by hand, laid on top, wins.

use super::Config;
use crate::density::gaussians_for_images;

/// Bytes for each Gaussian that may be trained, with which a file has the next two values on the measured hull
/// (docs/results.md, sizes). Fewer bytes come from fewer Gaussians and from a dearer byte together.
const BYTES_A_GAUSSIAN: f64 = 6.4;
/// Weight of a megabyte of attributes in the loss, and how it falls as there are more bytes.
const MEGABYTE: (f64, f64) = (0.03, -2.0);
/// Share of the Gaussians that a pass of pruning drops, and how it falls with the logarithm of the bytes; both bounded.
const PRUNED: (f64, f64) = (0.3, -0.17);
const PRUNED_BOUNDS: [f64; 2] = [0.1, 0.6];

impl Config {
    /// For images whose longer side has `pixels` pixels in place of those of this configuration: the resolution, and more
    /// or fewer Gaussians. `longest` is the longer side of the images in their files; they are never enlarged.
    pub fn for_pixels(&self, pixels: u32, longest: u32) -> Vec<String> {
        let before = f64::from(self.data.resolution.unwrap_or(longest));
        let ratio = f64::from(pixels.min(longest)) / before;
        let train = &self.train;
        let scaled = |count| gaussians_for_images(count, ratio);
        vec![
            format!("data.resolution={pixels}"),
            format!("train.densify.adaptive.max_gaussians={}", scaled(train.densify.strategies.adaptive.max_gaussians)),
            format!("train.guided_sampling.count={}", scaled(train.guided_sampling.count)),
        ]
    }

    /// For a file of at most `bytes`: how many Gaussians stay, and what a byte weighs at first. The trainer corrects the
    /// weight as it goes.
    pub fn for_target_bytes(&self, bytes: usize) -> Vec<String> {
        let Self { train, compression, .. } = self;
        let most = train.densify.strategies.adaptive.max_gaussians.max(1);
        let ratio = bytes as f64 / most as f64 / BYTES_A_GAUSSIAN;
        let mut wishes = vec![format!("compression.target_bytes={bytes}")];
        wishes.extend(self.with_a_rate());
        if compression.rate.attributes {
            let [least, largest] = PRUNED_BOUNDS;
            let pruned = (PRUNED.0 + PRUNED.1 * ratio.ln()).clamp(least, largest);
            let weight = (MEGABYTE.0 * ratio.powf(MEGABYTE.1)).clamp(1e-4, 1.0);
            wishes.push(format!("compression.rate.attribute_lambda={weight:.5}"));
            // A short schedule of one's own may have left pruning, which is off, behind its end.
            if train.prune.iterations.iter().all(|pass| *pass <= train.fine_iterations) {
                wishes.push(format!("train.prune.fraction={pruned:.3}"));
            }
        }
        wishes
    }

    /// For a file with this PSNR on the test views, dB. The trainer corrects the weight of the rate as it goes.
    pub fn for_target_db(&self, quality: f64) -> Vec<String> {
        let wish = format!("compression.target_db={quality:?}");
        std::iter::once(wish).chain(self.with_a_rate()).collect()
    }

    /// Without a rate in the loss, there is no weight that could follow a wish.
    fn with_a_rate(&self) -> Option<String> {
        (self.compression.rate.lambda <= 0.0).then(|| "compression.rate.lambda=0.007".to_owned())
    }

    /// The same schedule `factor` times as long: every key that counts iterations of a stage. 0 stays 0, "never".
    pub fn for_schedule(&self, factor: f64) -> Vec<String> {
        let Self { train, compression, .. } = self;
        let adaptive = &train.densify.strategies.adaptive;
        let one = [
            ("train.coarse_iterations", train.coarse_iterations),
            ("train.fine_iterations", train.fine_iterations),
            ("train.sh_degree_interval", train.sh_degree_interval),
            ("train.photometric.l2_until", train.losses.photometric.l2_until),
            ("train.learning_rate.schedule_steps", train.learning_rate.schedule_steps.unwrap_or(0)),
            ("train.densify.adaptive.from", adaptive.from),
            ("train.densify.adaptive.until", adaptive.until),
            ("train.densify.adaptive.prune_from", adaptive.prune_from),
            ("train.densify.adaptive.opacity_reset_interval", adaptive.opacity_reset_interval),
            ("compression.rate.from", compression.rate.from),
            ("compression.rate.planes_until", compression.rate.planes_until),
            ("compression.steps.adaptive_from", compression.steps.adaptive_from),
        ];
        let scaled = |iterations: usize| match iterations {
            0 => 0,
            _ => ((iterations as f64 * factor).round() as usize).max(1),
        };
        // Pruning stays after densification, whatever is rounded.
        let after = scaled(train.densify.chosen().end()) + 1;
        let passes: Vec<usize> = train.prune.iterations.iter().map(|&pass| scaled(pass).max(after)).collect();
        let guided: Vec<usize> = train.guided_sampling.iterations.iter().map(|&pass| scaled(pass)).collect();
        let several = [("train.prune.iterations", passes), ("train.guided_sampling.iterations", guided)];
        let one = one.into_iter().map(|(key, value)| format!("{key}={}", scaled(value)));
        one.chain(several.into_iter().map(|(key, values)| format!("{key}={values:?}"))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::preset_names;

    #[test]
    fn a_schedule_of_the_same_length_changes_nothing() {
        for preset in ["hypernerf-cpu", "nerfds-cpu", "dnerf-lego-cpu+nodes+medium", "dnerf", "quickstart"] {
            let config = Config::load(preset, &[]).unwrap();
            assert_eq!(Config::load(preset, &config.for_schedule(1.0)).unwrap(), config, "{preset}");
        }
    }

    /// What is legal stays legal at every length: pruning after densification, cloning after it has begun.
    #[test]
    fn every_preset_can_be_longer_and_shorter() {
        for preset in preset_names() {
            let Ok(config) = Config::load(preset, &[]) else { continue };
            for factor in [0.01, 0.33, 7.1] {
                let longer = Config::load(preset, &config.for_schedule(factor)).unwrap();
                let expected = (config.train.fine_iterations as f64 * factor).round() as usize;
                assert_eq!(longer.train.fine_iterations, expected, "{preset}");
            }
        }
    }

    #[test]
    fn gaussians_follow_the_images() {
        let config = Config::load("hypernerf-cpu", &["data.resolution=200".into()]).unwrap();
        let most = |pixels, longest| {
            let config = Config::load("hypernerf-cpu", &config.for_pixels(pixels, longest)).unwrap();
            (config.data.resolution, config.train.densify.strategies.adaptive.max_gaussians)
        };
        let before = config.train.densify.strategies.adaptive.max_gaussians;
        assert_eq!(most(200, 480), (Some(200), before));
        assert_eq!(most(400, 480), (Some(400), (before as f64 * 2f64.powf(1.4)).round() as usize));
        // Smaller images stay as they are.
        assert_eq!(most(960, 400), (Some(960), most(400, 400).1));
    }

    /// At the hull's bytes, its values; with fewer bytes fewer Gaussians and a dearer byte, within bounds.
    #[test]
    fn fewer_bytes_are_fewer_gaussians_and_a_dearer_byte() {
        let config = Config::load("dnerf-cpu+nodes", &[]).unwrap();
        let at = |bytes| {
            let config = Config::load("dnerf-cpu+nodes", &config.for_target_bytes(bytes)).unwrap();
            assert_eq!(config.compression.target_bytes, bytes);
            assert!(config.compression.rate.lambda > 0.0);
            (config.train.prune.fraction, config.compression.rate.attribute_lambda)
        };
        assert_eq!(at(64_000), (0.3, 0.03));
        let (fraction, lambda) = at(40_000);
        assert!(fraction > 0.3 && lambda > 0.06, "{fraction}, {lambda}");
        assert_eq!(at(1000), (0.6, 1.0));
        assert_eq!(at(1_000_000_000), (0.1, 1e-4));
    }

    #[test]
    fn what_is_set_by_hand_wins() {
        let config = Config::load("hypernerf-cpu", &[]).unwrap();
        let mut overrides = [config.for_pixels(960, 960), config.for_schedule(2.0)].concat();
        overrides.extend(["train.fine_iterations=10000".into(), "train.densify.adaptive.max_gaussians=70".into()]);
        let changed = Config::load("hypernerf-cpu", &overrides).unwrap();
        assert_eq!(changed.train.fine_iterations, 10000);
        assert_eq!(changed.train.densify.strategies.adaptive.max_gaussians, 70);
        assert_eq!(changed.train.coarse_iterations, 2 * config.train.coarse_iterations);
    }
}
