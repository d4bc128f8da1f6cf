//! Ranges: what the types alone let through.

use light4gs_codec::plane_layout::check_resolution;
use light4gs_codec::{CodecError, checks};
use light4gs_data::Layouts;

use super::compression::{LEAST_WEIGHT_BITS, MOST_WEIGHT_BITS};
use super::{
    CompressionConfig, Config, ConfigError, DataConfig, DensifyConfig, EvalConfig, HexPlaneConfig, LearningRates,
    ModelConfig, Problem, PruneConfig, RegularizerConfig, TrainConfig,
};

/// Far above anything useful: a mistyped number must not ask for the machine's whole memory.
const MAX_PLANE_RESOLUTION: usize = 4096;
const MAX_CHANNELS: usize = 1024;
const MAX_WIDTH: usize = 4096;
const MAX_DEPTH: usize = 64;
const MAX_GAUSSIANS: usize = 50_000_000;
const MAX_IMAGE_WIDTH: u32 = 16_384;

pub(super) fn validate(config: &Config) -> Result<(), ConfigError> {
    let mut check = Check::default();
    check.that("seed", i64::try_from(config.seed).is_ok(), || format!("must be at most {} (TOML's limit)", i64::MAX));
    data(&mut check, &config.data);
    model(&mut check, &config.model);
    train(&mut check, &config.train);
    compression(&mut check, &config.compression);
    eval(&mut check, &config.eval);
    if check.problems.is_empty() { Ok(()) } else { Err(ConfigError::Invalid { problems: check.problems }) }
}

fn data(check: &mut Check, data: &DataConfig) {
    if let Some(name) = &data.layout {
        let known = Layouts::default().names();
        check.that("data.layout", known.contains(&name.as_str()), || {
            format!("is `{name}`; it must be empty (found by content) or one of {}", known.join(", "))
        });
    }
    check.range("data.frames", data.frames.unwrap_or(0), 0, 1_000_000);
    if let Some(width) = data.resolution {
        check.that("data.resolution", (8..=MAX_IMAGE_WIDTH).contains(&width), || {
            format!("is {width}; it must be 0 (leave images as they are) or 8 to {MAX_IMAGE_WIDTH} pixels")
        });
    }
    check.that("data.background", data.background.iter().all(|c| (0.0..=1.0).contains(c)), || {
        format!("is {:?}; every channel must lie in 0 to 1", data.background)
    });
    check.range("data.memory_limit_mib", data.memory_limit_mib as usize, 16, 1 << 24);
    check.range("data.initial_points", data.initial_points, 4, MAX_GAUSSIANS);
    check.positive("data.initial_box", f64::from(data.initial_box));
}

fn model(check: &mut Check, model: &ModelConfig) {
    check.range("model.sh_degree", model.sh_degree.into(), 0, 3);
    hexplane(check, &model.hexplane);
    check.range("model.deformation.width", model.deformation.width, 1, MAX_WIDTH);
    check.range("model.deformation.depth", model.deformation.depth, 0, MAX_DEPTH);
}

fn hexplane(check: &mut Check, planes: &HexPlaneConfig) {
    check.range("model.hexplane.channels", planes.channels, 1, MAX_CHANNELS);
    let illegal = check_resolution(planes.resolution).err();
    check.that("model.hexplane.resolution", illegal.is_none(), || format!("is {}", illegal.expect("it is illegal")));
    for (axis, size) in ["x", "y", "z", "t"].into_iter().zip(planes.resolution) {
        for &multiplier in if axis == "t" { &[1][..] } else { &planes.multipliers[..] } {
            let scaled = size.saturating_mul(multiplier);
            check.that("model.hexplane.resolution", scaled <= MAX_PLANE_RESOLUTION, || {
                format!("is {size} along {axis}, times {multiplier} it is over the limit of {MAX_PLANE_RESOLUTION}")
            });
        }
    }
    let multipliers = &planes.multipliers;
    let ascending = multipliers.windows(2).all(|pair| pair[0] < pair[1]);
    check.that("model.hexplane.multipliers", ascending && multipliers.first().is_some_and(|first| *first > 0), || {
        format!("is {multipliers:?}; it must hold at least one number, all above 0, each above the one before")
    });
    if illegal.is_none() {
        let narrow =
            |sizes: &[usize]| -> Vec<u32> { sizes.iter().map(|&s| u32::try_from(s).unwrap_or(u32::MAX)).collect() };
        let [x, y, z, t] = planes.resolution.map(|size| u32::try_from(size).unwrap_or(u32::MAX));
        let (channels, multipliers) = (u32::try_from(planes.channels).unwrap_or(u32::MAX), narrow(multipliers));
        check.encodable("model.hexplane.multipliers", checks::hexplane(channels, [x, y, z, t], &multipliers));
    }
}

fn train(check: &mut Check, train: &TrainConfig) {
    const MOST: usize = 100_000_000;
    check.range("train.coarse_iterations", train.coarse_iterations, 0, MOST);
    check.range("train.fine_iterations", train.fine_iterations, 0, MOST);
    check.that("train.fine_iterations", train.coarse_iterations > 0 || train.fine_iterations > 0, || {
        "and `train.coarse_iterations` are both 0: nothing would be trained".to_owned()
    });
    check.range("train.batch_size", train.batch_size, 1, 1024);
    check.toml_integer("train.coarse_times", train.coarse_times.unwrap_or(0));
    check.share("train.lambda_dssim", train.lambda_dssim);
    check.toml_integer("train.l2_until", train.l2_until);
    check.range("train.sh_degree_interval", train.sh_degree_interval, 1, MOST);
    check.range("train.checkpoint_interval", train.checkpoint_interval, 1, MOST);
    check.range("train.log_interval", train.log_interval, 1, MOST);
    check.range("train.keep_checkpoints", train.keep_checkpoints, 1, MOST);
    learning_rates(check, &train.learning_rate);
    densify(check, &train.densify);
    prune(check, &train.prune, train);
    regularizer(check, &train.regularizer);
}

fn learning_rates(check: &mut Check, rates: &LearningRates) {
    for (name, rate) in [
        ("means_init", rates.means_init),
        ("means_final", rates.means_final),
        ("deformation_init", rates.deformation_init),
        ("deformation_final", rates.deformation_final),
        ("grid_init", rates.grid_init),
        ("grid_final", rates.grid_final),
        ("sh_dc", rates.sh_dc),
        ("sh_rest_divisor", rates.sh_rest_divisor),
        ("opacity", rates.opacity),
        ("scale", rates.scale),
        ("rotation", rates.rotation),
        ("attributes_final_share", rates.attributes_final_share),
    ] {
        check.positive(&format!("train.learning_rate.{name}"), rate);
    }
    check.toml_integer("train.learning_rate.schedule_steps", rates.schedule_steps.unwrap_or(0));
}

fn densify(check: &mut Check, densify: &DensifyConfig) {
    let key = |name: &str| format!("train.densify.{name}");
    check.that("train.densify.from", densify.from <= densify.until, || {
        format!("is {}, after `train.densify.until`, which is {}", densify.from, densify.until)
    });
    for (name, value) in [
        ("from", densify.from),
        ("until", densify.until),
        ("prune_from", densify.prune_from),
        ("prune_above", densify.prune_above),
        ("opacity_reset_interval", densify.opacity_reset_interval),
    ] {
        check.toml_integer(&key(name), value);
    }
    for (name, value) in [("interval", densify.interval), ("prune_interval", densify.prune_interval)] {
        check.range(&key(name), value, 1, 100_000_000);
    }
    for (name, value) in [
        ("grad_threshold_coarse", densify.grad_threshold_coarse),
        ("grad_threshold_fine_init", densify.grad_threshold_fine_init),
        ("grad_threshold_fine_final", densify.grad_threshold_fine_final),
        ("percent_dense", densify.percent_dense),
    ] {
        check.positive(&key(name), value.into());
    }
    check.range(&key("max_gaussians"), densify.max_gaussians, 1, MAX_GAUSSIANS);
    for (name, value) in [
        ("opacity_threshold", densify.opacity_threshold),
        ("opacity_threshold_fine_init", densify.opacity_threshold_fine_init),
        ("opacity_threshold_fine_final", densify.opacity_threshold_fine_final),
    ] {
        check.share(&key(name), value);
    }
}

fn prune(check: &mut Check, prune: &PruneConfig, train: &TrainConfig) {
    check.that("train.prune.fraction", (0.0..1.0).contains(&prune.fraction), || {
        format!("is {}; it must be at least 0 and below 1", prune.fraction)
    });
    if prune.fraction > 0.0 {
        for &iteration in &prune.iterations {
            check.that("train.prune.iterations", (1..=train.fine_iterations).contains(&iteration), || {
                format!("has {iteration}, but the fine stage has iterations 1 to {}", train.fine_iterations)
            });
            check.that("train.prune.iterations", iteration > train.densify.until, || {
                format!("has {iteration}; pruning follows densification, which ends at {}", train.densify.until)
            });
        }
    }
    check.positive("train.prune.volume_exponent", prune.volume_exponent);
}

fn regularizer(check: &mut Check, weights: &RegularizerConfig) {
    for (name, weight) in
        [("plane_tv", weights.plane_tv), ("time_smoothness", weights.time_smoothness), ("time_l1", weights.time_l1)]
    {
        check.that(&format!("train.regularizer.{name}"), weight.is_finite() && weight >= 0.0, || {
            format!("is {weight}; it must be finite and at least 0")
        });
    }
}

fn compression(check: &mut Check, compression: &CompressionConfig) {
    let CompressionConfig { profile: _, rate, context, steps, sh, attributes, weights } = compression;
    check.that("compression.rate.lambda", rate.lambda.is_finite() && rate.lambda >= 0.0, || {
        format!("is {}; it must be finite and at least 0", rate.lambda)
    });
    check.range("compression.rate.interval", rate.interval, 1, 1000);
    check.that("compression.rate.fraction", rate.fraction > 0.0 && rate.fraction <= 1.0, || {
        format!("is {}; it must be above 0 and at most 1", rate.fraction)
    });
    check.toml_integer("compression.rate.from", rate.from);
    check.toml_integer("compression.rate.planes_until", rate.planes_until);
    check.that("compression.rate.planes_until", rate.planes_until == 0 || rate.planes_until > rate.from, || {
        format!("is {}; it must be 0 (never) or above compression.rate.from, {}", rate.planes_until, rate.from)
    });
    check.that(
        "compression.context.high_scale_hyperprior",
        !context.high_scale_hyperprior || (context.hyperprior && context.inter_scale),
        || "needs `compression.context.hyperprior` and `compression.context.inter_scale`".to_owned(),
    );
    check.range("compression.context.fit_iterations", context.fit_iterations, 1, 1_000_000);
    check.toml_integer("compression.steps.adaptive_from", steps.adaptive_from);
    for (name, value) in [
        ("context.learning_rate_init", context.learning_rate_init),
        ("context.learning_rate_final", context.learning_rate_final),
        ("steps.learning_rate", steps.learning_rate),
        ("sh.learning_rate_init", sh.learning_rate_init),
        ("sh.learning_rate_final", sh.learning_rate_final),
    ] {
        check.positive(&format!("compression.{name}"), value);
    }
    check.encodable("compression.steps.space_only", checks::plane_step(steps.space_only as f32));
    check.encodable("compression.steps.space_time", checks::plane_step(steps.space_time as f32));
    check.encodable("compression.sh.step", checks::sh_step(sh.step as f32));
    for (name, step) in attributes.steps().named() {
        check.encodable(&format!("compression.attributes.{name}"), checks::attribute_step(name, step));
    }
    for (part, tolerance) in
        [("steps", steps.search_tolerance), ("sh", sh.search_tolerance), ("attributes", attributes.search_tolerance)]
    {
        let key = format!("compression.{part}.search_tolerance");
        check.that(&key, tolerance.is_finite() && tolerance >= 0.0, || {
            format!("is {tolerance}; it must be finite and at least 0 dB")
        });
    }
    for (name, bits) in [("deformation_bits", weights.deformation_bits), ("context_bits", weights.context_bits)] {
        let (least, most) = (LEAST_WEIGHT_BITS.into(), MOST_WEIGHT_BITS.into());
        check.range(&format!("compression.weights.{name}"), bits.into(), least, most);
    }
}

fn eval(check: &mut Check, eval: &EvalConfig) {
    check.toml_integer("eval.fps_warmup", eval.fps_warmup);
    check.range("eval.fps_frames", eval.fps_frames, 1, 1_000_000);
    check.toml_integer("eval.interval", eval.interval);
    check.that("eval.views", eval.views > 0 || eval.interval == 0, || {
        "is 0, but `eval.interval` is not: nothing could be measured".to_owned()
    });
    check.toml_integer("eval.views", eval.views);
}

/// Collects what is wrong.
#[derive(Default)]
struct Check {
    problems: Vec<Problem>,
}

impl Check {
    fn that(&mut self, key: &str, holds: bool, message: impl FnOnce() -> String) {
        if !holds {
            self.problems.push(Problem { key: key.to_owned(), message: message() });
        }
    }

    fn range(&mut self, key: &str, value: usize, least: usize, most: usize) {
        self.that(key, (least..=most).contains(&value), || format!("is {value}; it must be {least} to {most}"));
    }

    fn toml_integer(&mut self, key: &str, value: usize) {
        self.range(key, value, 0, i64::MAX as usize);
    }

    fn positive(&mut self, key: &str, value: f64) {
        self.that(key, value.is_finite() && value > 0.0, || format!("is {value}; it must be finite and above 0"));
    }

    /// What the encoder says, so that nothing is trained that it would refuse.
    fn encodable(&mut self, key: &str, answer: Result<(), CodecError>) {
        if let Err(error) = answer {
            self.that(key, false, || format!("is nothing that the encoder takes: {error}"));
        }
    }

    fn share(&mut self, key: &str, value: f32) {
        self.that(key, (0.0..=1.0).contains(&value), || format!("is {value}; it must lie in 0 to 1"));
    }
}
