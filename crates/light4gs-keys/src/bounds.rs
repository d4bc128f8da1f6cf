//! The values that a key may have. They are checked before a run begins, `docs/configuration.md` shows them, and a test
//! trains with the ends of every range.

use std::fmt;

use crate::Choices;

/// The values that a key may have. A table's conditions on several keys together are checked elsewhere.
#[derive(Clone, Copy, Debug)]
pub enum Bounds {
    /// True or false.
    Flag,
    /// Any text, such as a path.
    Text,
    /// One of the names of a [`choice!`](crate::choice).
    Name(&'static Choices),
    /// A text that the key's own type parses.
    Parsed {
        /// Texts that are legal.
        names: &'static [&'static str],
        /// Other legal texts, in words.
        also: &'static str,
    },
    /// A name that is looked up when a run begins, or an empty text.
    NameOrNone {
        /// The thing that is named.
        what: &'static str,
        /// The meaning of an empty text.
        none: &'static str,
        /// The known names.
        names: fn() -> Vec<&'static str>,
    },
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
    /// Numbers by name ([`ByName`](crate::ByName)): each of them.
    ByName(&'static Bounds),
}

use Bounds::{ByName, Flag, List, Name, NameOrNone, Number, Parsed, Text, Whole, WholeOrNone};

/// Iterations, and intervals of them.
const MOST_ITERATIONS: u64 = 100_000_000;
/// TOML has no larger number.
pub const MOST_INTEGER: u64 = i64::MAX as u64;

/// A number of iterations.
pub const ITERATIONS: Bounds = Whole { least: 0, most: MOST_ITERATIONS };
/// Iterations from one event to the next.
pub const INTERVAL: Bounds = Whole { least: 1, most: MOST_ITERATIONS };
/// An iteration that may lie beyond the end.
pub const ITERATION: Bounds = Whole { least: 0, most: MOST_INTEGER };
/// A share of a whole.
pub const SHARE: Bounds = Number { least: 0.0, most: 1.0 };
/// A learning rate: float32 can hold it, even multiplied by a scene's extent.
pub const RATE: Bounds = Number { least: 1e-20, most: 1e3 };
/// A threshold.
pub const THRESHOLD: Bounds = Number { least: 1e-30, most: 1e30 };
/// The weight of a term of a loss.
pub const WEIGHT: Bounds = Number { least: 0.0, most: 1e6 };
/// A PSNR, or the loss of it that a search for coarser steps may cause, dB.
pub const DECIBELS: Bounds = Number { least: 0.0, most: 100.0 };

impl fmt::Display for Bounds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Flag => write!(formatter, "true or false"),
            Text => write!(formatter, "any text"),
            NameOrNone { none, names, .. } => write!(formatter, "empty ({none}) or one of {}", names().join(", ")),
            Name(choices) => write!(formatter, "one of {}", choices.names.join(", ")),
            Parsed { names, also } => write!(formatter, "one of {}; {also}", names.join(", ")),
            Whole { least, most: MOST_INTEGER } => write!(formatter, "{least} or more"),
            Whole { least, most } => write!(formatter, "{least} to {most}"),
            WholeOrNone { least, most } => write!(formatter, "0, or {least} to {most}"),
            Number { least, most } => write!(formatter, "{} to {}", Short(*least), Short(*most)),
            List { element, .. } | ByName(element) => write!(formatter, "each {element}"),
        }
    }
}

/// A number without long runs of zeros.
pub(crate) struct Short(pub(crate) f64);

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
    /// Why a value of the right type cannot be read at all, in the words of serde: a name that is none of a choice's, or
    /// a list of another length.
    pub fn unreadable(&self, value: &toml::Value) -> Option<String> {
        match (self, value) {
            (Name(choices), toml::Value::String(name)) => choices.unknown(name).map(|unknown| unknown.to_string()),
            (List { length: Some(length), .. }, toml::Value::Array(values)) if values.len() != *length => {
                Some(format!("invalid length {}, expected an array of length {length}", values.len()))
            }
            (List { element, .. }, toml::Value::Array(values)) => {
                values.iter().find_map(|value| element.unreadable(value))
            }
            _ => None,
        }
    }
}
