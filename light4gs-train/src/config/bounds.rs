//! What each key may hold, in one table: it is checked before anything is made, `docs/configuration.md` shows it, and a test
//! trains with the ends of every range.

use std::fmt;

use light4gs_codec::checks::LEAST_STEP;
use light4gs_model::ShKind;
use serde_json::Value;

use super::compression::{LEAST_WEIGHT_BITS, MOST_WEIGHT_BITS};
use super::{
    Config, ContextArchitecture, DEVICES, EvalSplit, FileProfile, Problem, PruneScore, PruneVolume, RateWeighting,
    Sampling,
};

/// What a key may hold. What keys may not hold together is said in `validate.rs`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounds {
    /// True or false.
    Flag,
    /// Any text, such as a path.
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// The name of a back end: [`DEVICES`], `wgpu` also with an adapter.
    Device,
    /// A whole number.
    Whole {
        /// The smallest.
        least: u64,
        /// The largest.
        most: u64,
    },
    /// A whole number, or 0 for none.
    WholeOrNone {
        /// The smallest but for 0.
        least: u64,
        /// The largest.
        most: u64,
    },
    /// A number.
    Number {
        /// The smallest.
        least: f64,
        /// The largest.
        most: f64,
    },
    /// A list.
    List {
        /// Every element.
        element: &'static Bounds,
        /// The number of elements; any if not given.
        length: Option<usize>,
    },
}

use Bounds::{Device, Flag, List, Number, Text, Whole, WholeOrNone, Word};

/// Iterations, and intervals of them.
const MOST_ITERATIONS: u64 = 100_000_000;
/// TOML has no larger number.
const MOST_INTEGER: u64 = i64::MAX as u64;
const MOST_GAUSSIANS: u64 = 50_000_000;
/// Far above anything useful: a mistyped number must not ask for the machine's whole memory.
pub(super) const MOST_PLANE_RESOLUTION: u64 = 4096;

const ITERATIONS: Bounds = Whole { least: 0, most: MOST_ITERATIONS };
const INTERVAL: Bounds = Whole { least: 1, most: MOST_ITERATIONS };
/// An iteration that may lie beyond the end.
const ITERATION: Bounds = Whole { least: 0, most: MOST_INTEGER };
const SHARE: Bounds = Number { least: 0.0, most: 1.0 };
/// A learning rate: float32 holds it, also times a scene's extent.
const RATE: Bounds = Number { least: 1e-20, most: 1e3 };
const THRESHOLD: Bounds = Number { least: 1e-30, most: 1e30 };
const WEIGHT: Bounds = Number { least: 0.0, most: 1e6 };
/// A quantization step that the encoder takes.
const STEP: Bounds = Number { least: LEAST_STEP as f64, most: 1e3 };
/// What a search for coarser steps may cost, dB.
const TOLERANCE: Bounds = Number { least: 0.0, most: 100.0 };
const WEIGHT_BITS: Bounds = Whole { least: LEAST_WEIGHT_BITS as u64, most: MOST_WEIGHT_BITS as u64 };

/// Every key in the order of the configuration, and what it may hold.
pub const BOUNDS: &[(&str, Bounds)] = &[
    ("seed", Whole { least: 0, most: MOST_INTEGER }),
    ("device", Device),
    ("data.layout", Text),
    ("data.frames", WholeOrNone { least: 1, most: 1_000_000 }),
    ("data.resolution", WholeOrNone { least: 8, most: 16_384 }),
    ("data.background", List { element: &SHARE, length: Some(3) }),
    ("data.memory_limit_mib", Whole { least: 16, most: 1 << 24 }),
    ("data.initial_points", Whole { least: 4, most: MOST_GAUSSIANS }),
    ("data.initial_box", Number { least: 1e-6, most: 1e6 }),
    ("model.sh_degree", Whole { least: 0, most: 3 }),
    ("model.coordinates.pca", Flag),
    ("model.coordinates.contraction", Flag),
    ("model.hexplane.channels", Whole { least: 1, most: 1024 }),
    ("model.hexplane.resolution", List { element: &Whole { least: 4, most: MOST_PLANE_RESOLUTION }, length: Some(4) }),
    (
        "model.hexplane.multipliers",
        List { element: &Whole { least: 1, most: MOST_PLANE_RESOLUTION / 4 }, length: None },
    ),
    ("model.deformation.width", Whole { least: 1, most: 4096 }),
    ("model.deformation.depth", Whole { least: 0, most: 64 }),
    ("model.deformation.position", Flag),
    ("model.deformation.scale", Flag),
    ("model.deformation.rotation", Flag),
    ("model.deformation.opacity", Flag),
    ("model.deformation.sh", Flag),
    ("model.deformation.differentiate_points", Flag),
    ("train.coarse_iterations", ITERATIONS),
    ("train.fine_iterations", ITERATIONS),
    ("train.batch_size", Whole { least: 1, most: 1024 }),
    ("train.sampling", Word(Sampling::NAMES)),
    ("train.coarse_times", ITERATION),
    ("train.lambda_dssim", SHARE),
    ("train.l2_until", ITERATION),
    ("train.sh_degree_interval", INTERVAL),
    ("train.checkpoint_interval", INTERVAL),
    ("train.log_interval", INTERVAL),
    ("train.keep_checkpoints", INTERVAL),
    ("train.learning_rate.means_init", RATE),
    ("train.learning_rate.means_final", RATE),
    ("train.learning_rate.deformation_init", RATE),
    ("train.learning_rate.deformation_final", RATE),
    ("train.learning_rate.grid_init", RATE),
    ("train.learning_rate.grid_final", RATE),
    ("train.learning_rate.sh_dc", RATE),
    ("train.learning_rate.sh_rest_divisor", Number { least: 1e-3, most: 1e9 }),
    ("train.learning_rate.opacity", RATE),
    ("train.learning_rate.scale", RATE),
    ("train.learning_rate.rotation", RATE),
    ("train.learning_rate.attributes_final_share", Number { least: 1e-9, most: 1e3 }),
    ("train.learning_rate.schedule_steps", ITERATION),
    ("train.learning_rate.scale_by_extent", Flag),
    ("train.densify.from", ITERATION),
    ("train.densify.until", ITERATION),
    ("train.densify.interval", INTERVAL),
    ("train.densify.grad_threshold_coarse", THRESHOLD),
    ("train.densify.grad_threshold_fine_init", THRESHOLD),
    ("train.densify.grad_threshold_fine_final", THRESHOLD),
    ("train.densify.percent_dense", Number { least: 1e-9, most: 1e9 }),
    ("train.densify.max_gaussians", Whole { least: 1, most: MOST_GAUSSIANS }),
    ("train.densify.opacity_threshold", SHARE),
    ("train.densify.opacity_threshold_fine_init", SHARE),
    ("train.densify.opacity_threshold_fine_final", SHARE),
    ("train.densify.prune_from", ITERATION),
    ("train.densify.prune_interval", INTERVAL),
    ("train.densify.prune_above", ITERATION),
    ("train.densify.opacity_reset_interval", ITERATION),
    ("train.prune.fraction", Number { least: 0.0, most: 0.999 }),
    ("train.prune.iterations", List { element: &INTERVAL, length: None }),
    ("train.prune.score", Word(PruneScore::NAMES)),
    ("train.prune.volume", Word(PruneVolume::NAMES)),
    ("train.prune.volume_exponent", Number { least: 1e-6, most: 3.0 }),
    ("train.prune.one_camera_per_time", Flag),
    ("train.regularizer.plane_tv", WEIGHT),
    ("train.regularizer.time_smoothness", WEIGHT),
    ("train.regularizer.time_l1", WEIGHT),
    ("compression.profile", Word(FileProfile::NAMES)),
    ("compression.rate.lambda", WEIGHT),
    ("compression.rate.weighting", Word(RateWeighting::NAMES)),
    ("compression.rate.planes", Flag),
    ("compression.rate.sh", Flag),
    ("compression.rate.interval", Whole { least: 1, most: 1000 }),
    ("compression.rate.fraction", Number { least: 1e-6, most: 1.0 }),
    ("compression.rate.from", ITERATION),
    ("compression.rate.planes_until", ITERATION),
    ("compression.context.architecture", Word(ContextArchitecture::NAMES)),
    ("compression.context.hyperprior", Flag),
    ("compression.context.checkerboard", Flag),
    ("compression.context.inter_plane", Flag),
    ("compression.context.inter_scale", Flag),
    ("compression.context.high_scale_hyperprior", Flag),
    ("compression.context.learning_rate_init", RATE),
    ("compression.context.learning_rate_final", RATE),
    ("compression.context.fit_iterations", Whole { least: 1, most: 1_000_000 }),
    ("compression.steps.space_only", STEP),
    ("compression.steps.space_time", STEP),
    ("compression.steps.adaptive", Flag),
    ("compression.steps.adaptive_from", ITERATION),
    ("compression.steps.refine", Flag),
    ("compression.steps.per_scale", Flag),
    ("compression.steps.learning_rate", RATE),
    ("compression.steps.search_tolerance", TOLERANCE),
    ("compression.sh.model", Word(&ShKind::NAMES)),
    ("compression.sh.step", STEP),
    ("compression.sh.learning_rate_init", RATE),
    ("compression.sh.learning_rate_final", RATE),
    ("compression.sh.search_tolerance", TOLERANCE),
    ("compression.attributes.position", STEP),
    ("compression.attributes.log_scale", STEP),
    ("compression.attributes.quaternion", STEP),
    ("compression.attributes.opacity_logit", STEP),
    ("compression.attributes.sh_dc", STEP),
    ("compression.attributes.search_tolerance", TOLERANCE),
    ("compression.weights.deformation_bits", WEIGHT_BITS),
    ("compression.weights.context_bits", WEIGHT_BITS),
    ("eval.splits", List { element: &Word(EvalSplit::NAMES), length: None }),
    ("eval.save_renders", Flag),
    ("eval.fps_warmup", Whole { least: 0, most: 1_000_000 }),
    ("eval.fps_frames", Whole { least: 1, most: 1_000_000 }),
    ("eval.interval", ITERATION),
    ("eval.views", ITERATION),
    ("eval.lpips", List { element: &Text, length: None }),
];

impl fmt::Display for Bounds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Flag => write!(formatter, "true or false"),
            Text => write!(formatter, "any text"),
            Word(words) => write!(formatter, "one of {}", words.join(", ")),
            Device => write!(formatter, "one of {}; wgpu also with an adapter", DEVICES.join(", ")),
            Whole { least, most: MOST_INTEGER } => write!(formatter, "{least} or more"),
            Whole { least, most } => write!(formatter, "{least} to {most}"),
            WholeOrNone { least, most } => write!(formatter, "0, or {least} to {most}"),
            Number { least, most } => write!(formatter, "{} to {}", Short(*least), Short(*most)),
            List { element, .. } => write!(formatter, "each {element}"),
        }
    }
}

/// A number without rows of zeros.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // What came from a float32 is shown with a float32's digits.
        let (value, narrow) = (self.0, self.0 as f32);
        let exact = f64::from(narrow) == value;
        match (value == 0.0 || (1e-4..1e6).contains(&value.abs()), exact) {
            (true, true) => write!(formatter, "{narrow}"),
            (true, false) => write!(formatter, "{value}"),
            (false, true) => write!(formatter, "{narrow:e}"),
            (false, false) => write!(formatter, "{value:e}"),
        }
    }
}

impl Bounds {
    /// What is wrong with a value, if it is out of bounds. Types have been checked, words parsed.
    fn problem(&self, value: &Value) -> Option<String> {
        let outside = |shown: &dyn fmt::Display| Some(format!("is {shown}; it must be {self}"));
        match (self, value) {
            (Whole { least, most }, Value::Number(number)) => {
                let whole = number.as_u64()?;
                if (*least..=*most).contains(&whole) { None } else { outside(&whole) }
            }
            (WholeOrNone { least, most }, Value::Number(number)) => {
                let whole = number.as_u64()?;
                if whole == 0 || (*least..=*most).contains(&whole) { None } else { outside(&whole) }
            }
            (Number { least, most }, Value::Number(number)) => {
                let float = number.as_f64()?;
                // As float32, which all numbers become: some keys hold no more, and their 1e-6 is a little below ours.
                let holds = (*least as f32..=*most as f32).contains(&(float as f32));
                if holds { None } else { outside(&Short(float)) }
            }
            // JSON has no NaN and no infinities.
            (Number { .. }, Value::Null) => outside(&"no finite number"),
            (List { element, length }, Value::Array(values)) => {
                if length.is_some_and(|length| length != values.len()) {
                    return outside(&format_args!("a list of {}", values.len()));
                }
                values
                    .iter()
                    .find_map(|value| element.problem(value))
                    .map(|problem| format!("has an element that {problem}"))
            }
            _ => None,
        }
    }
}

/// All values out of bounds, in the order of the keys.
pub(super) fn problems(config: &Config) -> Vec<Problem> {
    let table = serde_json::to_value(config).expect("a configuration is plain data");
    let check = |(key, bounds): &(&str, Bounds)| {
        let value = key.split('.').try_fold(&table, |table, name| table.get(name));
        let message = bounds.problem(value.unwrap_or(&Value::Null))?;
        Some(Problem { key: (*key).to_owned(), message })
    };
    BOUNDS.iter().filter_map(check).collect()
}

#[cfg(test)]
mod tests {
    use super::super::layering::schema;
    use super::*;

    #[test]
    fn every_key_has_bounds_and_they_are_documented() {
        fn keys(table: &toml::Table, prefix: &str, into: &mut Vec<String>) {
            for (key, value) in table {
                match value {
                    toml::Value::Table(table) => keys(table, &format!("{prefix}{key}."), into),
                    _ => into.push(format!("{prefix}{key}")),
                }
            }
        }
        let mut known = Vec::new();
        keys(&schema::defaults(), "", &mut known);
        let mut bounded: Vec<_> = BOUNDS.iter().map(|(key, _)| (*key).to_owned()).collect();
        known.sort();
        bounded.sort();
        assert_eq!(bounded, known);
        let guide = include_str!("../../../docs/configuration.md");
        for (key, bounds) in BOUNDS {
            let row = format!("| `{key}` | {bounds} |");
            assert!(guide.contains(&row), "docs/configuration.md lacks: {row}");
        }
    }

    #[test]
    fn numbers_that_float32_cannot_hold_are_refused() {
        for value in ["1e39", "3e38", "1e-45", "nan", "inf", "-1.0"] {
            for (key, bounds) in BOUNDS {
                if matches!(bounds, Number { .. }) && !(value == "1e-45" && bounds_zero(bounds)) {
                    let text = Config::from_toml(&format!("{key} = {value}"), "text").unwrap_err().to_string();
                    assert!(text.contains(key), "{key} = {value}: {text}");
                }
            }
        }
    }

    fn bounds_zero(bounds: &Bounds) -> bool {
        matches!(bounds, Number { least: 0.0, .. })
    }
}
