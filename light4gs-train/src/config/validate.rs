//! Checks of keys against each other. The bounds of a single key are where it is declared.

use light4gs_codec::plane_layout::{PlaneAxes, PlaneLayout, check_resolution};
use light4gs_codec::{CodecError, checks};
use serde_json::Value;

use super::model::{FieldKind, MOST_PLANE_RESOLUTION};
use super::{
    Bounds, CoarseToFineConfig, CompressionConfig, Config, ConfigError, EvalConfig, FileProfile, HexPlaneTable, KEYS,
    Key, ModelConfig, Problem, TrainConfig,
};
use crate::density::PruneConfig;

pub(super) fn validate(config: &Config) -> Result<(), ConfigError> {
    let mut check = Check { problems: out_of_bounds(config) };
    hexplane(&mut check, &config.model.hexplane);
    deformation(&mut check, &config.model);
    train(&mut check, &config.train);
    guided_sampling(&mut check, config);
    compression(&mut check, &config.compression);
    eval(&mut check, &config.eval);
    if check.problems.is_empty() { Ok(()) } else { Err(ConfigError::Invalid { problems: check.problems }) }
}

/// All values out of bounds, in the order of the keys.
fn out_of_bounds(config: &Config) -> Vec<Problem> {
    let table = serde_json::to_value(config).expect("a configuration is plain data");
    let problem = |key: String, bounds: &Bounds, value: &Value| {
        let message = bounds.problem(value)?;
        Some(Problem { key, message })
    };
    let check = |Key { path, bounds, .. }: &Key| -> Vec<Problem> {
        let value = path.split('.').try_fold(&table, |table, name| table.get(name)).unwrap_or(&Value::Null);
        match (bounds, value) {
            (Bounds::ByName(each), Value::Object(numbers)) => {
                numbers.iter().filter_map(|(name, value)| problem(format!("{path}.{name}"), each, value)).collect()
            }
            _ => problem(path.clone(), bounds, value).into_iter().collect(),
        }
    };
    KEYS.iter().flat_map(check).collect()
}

fn hexplane(check: &mut Check, planes: &HexPlaneTable) {
    let illegal = check_resolution(planes.resolution).err();
    let legal = illegal.is_none();
    check.that("model.hexplane.resolution", legal, || format!("is {}", illegal.expect("it is illegal")));
    for (axis, size) in ["x", "y", "z", "t"].into_iter().zip(planes.resolution) {
        for &multiplier in if axis == "t" { &[1][..] } else { &planes.multipliers[..] } {
            let scaled = size.saturating_mul(multiplier);
            check.that("model.hexplane.resolution", scaled as u64 <= MOST_PLANE_RESOLUTION, || {
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
        let layout = PlaneLayout::multiscale(&PlaneAxes::ALL, planes.resolution, multipliers);
        let answer = checks::feature_planes(narrow(planes.channels), &layout);
        check.encodable("model.hexplane.multipliers", answer);
    }
}

/// Width and depth may be too large together even where each is within its bounds.
fn deformation(check: &mut Check, model: &ModelConfig) {
    check.encodable("model.deformation.width", model.hexplane_field().deformation.check_size());
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

/// What is there for a moment only needs a lifetime.
fn guided_sampling(check: &mut Check, config: &Config) {
    const KEY: &str = "train.guided_sampling.iterations";
    let (iterations, most) = (&config.train.guided_sampling.iterations, config.train.fine_iterations);
    for iteration in iterations {
        check.that(KEY, (1..=most).contains(iteration), || {
            format!("has {iteration}, but the fine stage has iterations 1 to {most}")
        });
    }
    let lives = config.model.field == FieldKind::Nodes && config.model.nodes.lifetime;
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
    for (i, part) in context.parts.iter().enumerate() {
        check.that("compression.context.parts", !context.parts[..i].contains(part), || format!("has `{part}` twice"));
        for needed in part.0.needs() {
            let there = context.parts.iter().any(|other| other.0 == *needed);
            check.that("compression.context.parts", there, || {
                format!("has `{part}`, which needs `{}` beside it", needed.name())
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
        "is set beside compression.target_bytes; a file follows one of both, set the other to 0".to_owned()
    });
    let float32 = compression.profile == FileProfile::Float32;
    check.that("compression.layers", compression.layers == 1 || !float32, || {
        format!("is {}, but the profile \"float32\" has one layer; set compression.profile=compact", compression.layers)
    });
    check.encodable("compression.steps.space_only", checks::plane_step(steps.space_only as f32));
    check.encodable("compression.steps.space_time", checks::plane_step(steps.space_time as f32));
    check.encodable("compression.sh.step", checks::sh_step(sh.step as f32));
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
