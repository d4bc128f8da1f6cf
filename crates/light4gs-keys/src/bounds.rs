//! The values that a key may have. They are checked before a run begins, `docs/configuration.md` shows them, and a test
//! trains with the ends of every range.

use std::fmt;

use light4gs_codec::checks::LEAST_STEP;
use serde_json::Value;

use super::nearest;

/// The values that a key may have. Conditions on several keys together are in `config/validate.rs`.
#[derive(Clone, Copy, Debug)]
pub enum Bounds {
    /// True or false.
    Flag,
    /// Any text, such as a path.
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// The name of a built-in kind of a part of the training.
    Kind {
        /// The names of the built-in kinds.
        names: &'static [&'static str],
        /// The file of the repository that lists them, for `docs/configuration.md`: adding a kind then changes only its
        /// own file and that one.
        list: &'static str,
    },
    /// The name of a dataset's layout, or empty for none.
    LayoutOrNone {
        /// The built-in names.
        names: fn() -> Vec<&'static str>,
    },
    /// The name of a back end: one of these, `wgpu` also with an adapter.
    Device(&'static [&'static str]),
    /// A whole number.
    Whole {
        /// The smallest.
        least: u64,
        /// The largest.
        most: u64,
    },
    /// A whole number, or 0 for none.
    WholeOrNone {
        /// The smallest value other than 0.
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

use Bounds::{Device, Flag, Kind, LayoutOrNone, List, Number, Text, Whole, WholeOrNone, Word};

/// Iterations, and intervals of them.
const MOST_ITERATIONS: u64 = 100_000_000;
/// TOML has no larger number.
pub(crate) const MOST_INTEGER: u64 = i64::MAX as u64;
pub(crate) const MOST_GAUSSIANS: u64 = 50_000_000;

pub(crate) const ITERATIONS: Bounds = Whole { least: 0, most: MOST_ITERATIONS };
pub(crate) const INTERVAL: Bounds = Whole { least: 1, most: MOST_ITERATIONS };
/// An iteration that may lie beyond the end.
pub(crate) const ITERATION: Bounds = Whole { least: 0, most: MOST_INTEGER };
pub(crate) const SHARE: Bounds = Number { least: 0.0, most: 1.0 };
/// A learning rate: float32 can hold it, even multiplied by a scene's extent.
pub(crate) const RATE: Bounds = Number { least: 1e-20, most: 1e3 };
pub(crate) const THRESHOLD: Bounds = Number { least: 1e-30, most: 1e30 };
pub(crate) const WEIGHT: Bounds = Number { least: 0.0, most: 1e6 };
/// A quantization step that the encoder accepts.
pub(crate) const STEP: Bounds = Number { least: LEAST_STEP as f64, most: 1e3 };
/// A PSNR, or the loss of it that a search for coarser steps may cause, dB.
pub(crate) const DECIBELS: Bounds = Number { least: 0.0, most: 100.0 };

impl fmt::Display for Bounds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Flag => write!(formatter, "true or false"),
            Text => write!(formatter, "any text"),
            LayoutOrNone { names } => write!(formatter, "empty (found by content) or one of {}", names().join(", ")),
            Word(words) | Kind { names: words, .. } => write!(formatter, "one of {}", words.join(", ")),
            Device(names) => write!(formatter, "one of {}; wgpu also with an adapter", names.join(", ")),
            Whole { least, most: MOST_INTEGER } => write!(formatter, "{least} or more"),
            Whole { least, most } => write!(formatter, "{least} to {most}"),
            WholeOrNone { least, most } => write!(formatter, "0, or {least} to {most}"),
            Number { least, most } => write!(formatter, "{} to {}", Short(*least), Short(*most)),
            List { element, .. } => write!(formatter, "each {element}"),
        }
    }
}

/// A number without long runs of zeros.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A value that was a float32 is shown with the digits of a float32.
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
    /// What is wrong with a value, if it is out of bounds. Its type has been checked, and words have been parsed.
    pub(crate) fn problem(&self, value: &Value) -> Option<String> {
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
                // Compared as float32, to which all numbers are converted: some keys are float32, and their 1e-6 is a
                // little below that of f64.
                let holds = (*least as f32..=*most as f32).contains(&(float as f32));
                if holds { None } else { outside(&Short(float)) }
            }
            (LayoutOrNone { names }, Value::String(name)) => {
                let nearest = nearest(names(), name)?;
                let known = name.is_empty() || names().contains(&name.as_str());
                let problem = || format!("is `{name}`, and the nearest layout is `{nearest}`; it must be {self}");
                (!known).then(problem)
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
