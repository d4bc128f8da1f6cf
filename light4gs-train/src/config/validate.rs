//! Checks of keys against each other. The bounds of a single key are where it is declared.

use light4gs_codec::plane_layout::AXIS_NAMES;
use light4gs_codec::{CodecError, checks};
use light4gs_keys::KeyTable;
use light4gs_model::{FieldKind, HexPlaneFieldConfig, MOST_PLANE_RESOLUTION};

use super::{
    CoarseToFineConfig, CompressionConfig, Config, ConfigError, EvalConfig, FileProfile, Problem, TrainConfig,
};
use crate::density::PruneConfig;

pub(super) fn validate(config: &Config) -> Result<(), ConfigError> {
    let mut check = Check { problems: Vec::new() };
    config.problems("", &mut check.problems);
    let [from, to] = config.data.between;
    check.that("data.between", from < to, || format!("is [{from}, {to}]; the first time must be before the last"));
    hexplane(&mut check, &config.model.fields.hexplane);
    train(&mut check, &config.train);
    guided_sampling(&mut check, config);
    compression(&mut check, &config.compression);
    eval(&mut check, &config.eval);
    if check.problems.is_empty() { Ok(()) } else { Err(ConfigError::Invalid { problems: check.problems }) }
}

fn hexplane(check: &mut Check, field: &HexPlaneFieldConfig) {
    let planes = &field.hexplane;
    let illegal = planes.check().err();
    let legal = illegal.is_none();
    check.that("model.hexplane.resolution", legal, || format!("is {}", illegal.expect("it is illegal")));
    for (axis, size) in AXIS_NAMES.into_iter().zip(planes.resolution) {
        for &multiplier in if axis == "t" { &[1][..] } else { &planes.multipliers[..] } {
            let scaled = size.saturating_mul(multiplier);
            check.that("model.hexplane.resolution", scaled <= MOST_PLANE_RESOLUTION, || {
                format!("is {size} along {axis}, times {multiplier} it is over the limit of {MOST_PLANE_RESOLUTION}")
            });
        }
    }
    let multipliers = &planes.multipliers;
    let ascending = multipliers.windows(2).all(|pair| pair[0] < pair[1]);
    check.that("model.hexplane.multipliers", ascending && multipliers.first().is_some_and(|first| *first > 0), || {
        format!("is {multipliers:?}; it must hold at least one number, all above 0, each above the one before")
    });
    if legal {
        let narrow = |size: usize| u32::try_from(size).unwrap_or(u32::MAX);
        let answer = checks::feature_planes(narrow(planes.channels), &planes.layout());
        check.encodable("model.hexplane.multipliers", answer);
    }
    // Width and depth may be too large together even where each is within its bounds.
    check.encodable("model.deformation.width", field.check_size());
}

fn train(check: &mut Check, train: &TrainConfig) {
    check.that("train.fine_iterations", train.coarse_iterations > 0 || train.fine_iterations > 0, || {
        "and `train.coarse_iterations` are both 0: nothing would be trained".to_owned()
    });
    let density = train.densify.chosen();
    if let Some((key, problem)) = density.problem() {
        let key = format!("train.densify.{}.{key}", train.densify.strategy);
        check.problems.push(Problem { key, message: problem });
    }
    prune(check, &train.prune, train, density.end());
    let CoarseToFineConfig { quarter_until, half_until } = train.coarse_to_fine;
    check.that("train.coarse_to_fine.half_until", half_until == 0.0 || half_until >= quarter_until, || {
        format!(
            "is {half_until}; it must be 0 (never) or not below train.coarse_to_fine.quarter_until, {quarter_until}"
        )
    });
}

/// Guided sampling adds Gaussians with a short life, so the attribute `lifetime` must be there.
fn guided_sampling(check: &mut Check, config: &Config) {
    const KEY: &str = "train.guided_sampling.iterations";
    let (iterations, most) = (&config.train.guided_sampling.iterations, config.train.fine_iterations);
    for iteration in iterations {
        check.that(KEY, (1..=most).contains(iteration), || {
            format!("has {iteration}, but the fine stage has iterations 1 to {most}")
        });
    }
    let lives = config.model.field == FieldKind::Nodes && config.model.fields.nodes.lifetime;
    check.that(KEY, iterations.is_empty() || lives, || {
        "asks for Gaussians that come and go: set `model.field=nodes` and `model.nodes.lifetime=true`, or no iteration".to_owned()
    });
}

fn prune(check: &mut Check, prune: &PruneConfig, train: &TrainConfig, densification_ends: usize) {
    if prune.fraction > 0.0 {
        for &iteration in &prune.iterations {
            check.that("train.prune.iterations", (1..=train.fine_iterations).contains(&iteration), || {
                format!("has {iteration}, but the fine stage has iterations 1 to {}", train.fine_iterations)
            });
            check.that("train.prune.iterations", iteration > densification_ends, || {
                format!("has {iteration}; pruning follows densification, which ends at {densification_ends}")
            });
        }
    }
}

fn compression(check: &mut Check, compression: &CompressionConfig) {
    let CompressionConfig { rate, context, steps, sh, attributes, .. } = compression;
    check.that("compression.rate.planes_until", rate.planes_until == 0 || rate.planes_until > rate.from, || {
        format!("is {}; it must be 0 (never) or above compression.rate.from, {}", rate.planes_until, rate.from)
    });
    let parts = &context.model.parts;
    for (i, part) in parts.iter().enumerate() {
        check.that("compression.context.parts", !parts[..i].contains(part), || format!("has `{part}` twice"));
        for needed in part.needs() {
            check.that("compression.context.parts", parts.contains(needed), || {
                format!("has `{part}`, which needs `{needed}` beside it")
            });
        }
    }
    let wishes = [
        ("compression.target_bytes", compression.target_bytes > 0),
        ("compression.target_db", compression.target_db > 0.0),
    ];
    for (key, wished) in wishes {
        check.that(key, !wished || compression.profile == FileProfile::Compact, || {
            "is set, but only the profile \"compact\" has steps that can follow it; set compression.profile=compact"
                .to_owned()
        });
    }
    check.that("compression.target_db", !wishes.iter().all(|(_, wished)| *wished), || {
        "is set beside compression.target_bytes; a file can have only one of the two targets: set the other to 0"
            .to_owned()
    });
    let float32 = compression.profile == FileProfile::Float32;
    check.that("compression.layers", compression.layers == 1 || !float32, || {
        format!("is {}, but the profile \"float32\" has one layer; set compression.profile=compact", compression.layers)
    });
    check.encodable("compression.steps.space_only", checks::plane_step(steps.initial.space_only as f32));
    check.encodable("compression.steps.space_time", checks::plane_step(steps.initial.space_time as f32));
    check.encodable("compression.sh.step", checks::sh_step(sh.entropy.step as f32));
    for (name, step) in attributes.steps.iter() {
        check.encodable(&format!("compression.attributes.steps.{name}"), checks::attribute_step(name, step as f32));
    }
}

fn eval(check: &mut Check, eval: &EvalConfig) {
    let twice = eval.splits.iter().enumerate().find(|(i, split)| eval.splits[..*i].contains(split));
    check.that("eval.splits", twice.is_none(), || {
        format!("has `{}` twice", twice.map_or("", |(_, split)| split.name()))
    });
    check.that("eval.views", eval.views > 0 || eval.interval == 0, || {
        "is 0, but `eval.interval` is not: nothing could be measured".to_owned()
    });
}

/// Collects what is wrong.
struct Check {
    problems: Vec<Problem>,
}

impl Check {
    fn that(&mut self, key: &str, holds: bool, message: impl FnOnce() -> String) {
        if !holds {
            self.problems.push(Problem { key: key.to_owned(), message: message() });
        }
    }

    /// Asks the encoder, so that nothing is trained that it would refuse. A value that is out of its bounds has been
    /// reported already.
    fn encodable(&mut self, key: &str, answer: Result<(), CodecError>) {
        let known = self.problems.iter().any(|problem| problem.key == key);
        if let (Err(error), false) = (answer, known) {
            self.that(key, false, || format!("cannot be encoded: {error}"));
        }
    }
}
