//! The types that a key may have, and the check of a value against its bounds.

use std::fmt;
use std::path::PathBuf;

use crate::bounds::Short;
use crate::{Bounds, nearest};

/// One value that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Full path of the key, such as `train.prune.fraction`.
    pub key: String,
    /// The fault, and the legal values.
    pub message: String,
}

/// A type that a key may have.
pub trait KeyValue {
    /// The fault of a value that is out of bounds. A type whose every value is legal, such as that of a choice, keeps the
    /// default.
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        let _ = bounds;
        None
    }

    /// Appends the fault of the value of a key, if it has one. `key` is its full path.
    fn check(&self, bounds: &Bounds, key: &str, into: &mut Vec<Problem>) {
        into.extend(self.problem(bounds).map(|message| Problem { key: key.to_owned(), message }));
    }
}

impl KeyValue for bool {}

impl KeyValue for PathBuf {}

impl KeyValue for String {
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        let Bounds::NameOrNone { what, names, .. } = bounds else { return None };
        let names = names();
        if self.is_empty() || names.contains(&self.as_str()) {
            return None;
        }
        let nearest = nearest(names, self)?;
        Some(format!("is `{self}`, and the nearest {what} is `{nearest}`; it must be {bounds}"))
    }
}

fn outside(shown: impl fmt::Display, bounds: &Bounds) -> Option<String> {
    Some(format!("is {shown}; it must be {bounds}"))
}

fn of_whole(value: u64, bounds: &Bounds) -> Option<String> {
    let holds = match bounds {
        Bounds::Whole { least, most } => (*least..=*most).contains(&value),
        Bounds::WholeOrNone { least, most } => value == 0 || (*least..=*most).contains(&value),
        _ => true,
    };
    if holds { None } else { outside(value, bounds) }
}

fn of_number(value: f64, bounds: &Bounds) -> Option<String> {
    let Bounds::Number { least, most } = bounds else { return None };
    if !value.is_finite() {
        return outside("no finite number", bounds);
    }
    // Compared as float32, to which all numbers are converted: some keys are float32, and their 1e-6 is a little below
    // that of f64.
    let holds = (*least as f32..=*most as f32).contains(&(value as f32));
    if holds { None } else { outside(Short(value), bounds) }
}

fn of_list<T: KeyValue>(values: &[T], bounds: &Bounds) -> Option<String> {
    let Bounds::List { element, length } = bounds else { return None };
    if length.is_some_and(|length| length != values.len()) {
        return outside(format_args!("a list of {}", values.len()), bounds);
    }
    let problem = values.iter().find_map(|value| value.problem(element))?;
    Some(format!("has an element that {problem}"))
}

macro_rules! numbers {
    ($($type:ty => $problem:ident as $wide:ty;)+) => {
        $(impl KeyValue for $type {
            fn problem(&self, bounds: &Bounds) -> Option<String> {
                $problem(*self as $wide, bounds)
            }
        })+
    };
}

numbers! {
    u8 => of_whole as u64;
    u32 => of_whole as u64;
    u64 => of_whole as u64;
    usize => of_whole as u64;
    f32 => of_number as f64;
    f64 => of_number as f64;
}

/// An absent value is checked as the one that stands for it in TOML: see [`optional`](crate::optional).
impl<T: KeyValue + Default> KeyValue for Option<T> {
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        match self {
            Some(value) => value.problem(bounds),
            None => T::default().problem(bounds),
        }
    }
}

impl<T: KeyValue> KeyValue for Vec<T> {
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        of_list(self, bounds)
    }
}

impl<T: KeyValue, const N: usize> KeyValue for [T; N] {
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        of_list(self, bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARE: Bounds = Bounds::Number { least: 0.0, most: 1.0 };
    const COUNT: Bounds = Bounds::WholeOrNone { least: 2, most: 9 };

    #[test]
    fn numbers_are_compared_as_float32() {
        const SMALL: Bounds = Bounds::Number { least: 1e-6, most: 1.0 };
        assert_eq!(1e-6f32.problem(&SMALL), None);
        assert_eq!(1e-6f64.problem(&SMALL), None);
        assert_eq!(1e-7f64.problem(&SMALL).as_deref(), Some("is 1e-7; it must be 1e-6 to 1"));
        assert_eq!(f32::NAN.problem(&SHARE).as_deref(), Some("is no finite number; it must be 0 to 1"));
        assert_eq!(f64::INFINITY.problem(&SHARE).as_deref(), Some("is no finite number; it must be 0 to 1"));
    }

    #[test]
    fn what_is_absent_is_legal_where_it_may_be() {
        assert_eq!(None::<usize>.problem(&COUNT), None);
        assert_eq!(Some(3u32).problem(&COUNT), None);
        assert_eq!(Some(1u32).problem(&COUNT).as_deref(), Some("is 1; it must be 0, or 2 to 9"));
    }

    #[test]
    fn lists_name_their_length_or_the_element() {
        const THREE: Bounds = Bounds::List { element: &SHARE, length: Some(3) };
        assert_eq!([0.0f32, 0.5, 1.0].problem(&THREE), None);
        assert_eq!(vec![0.5f32; 2].problem(&THREE).as_deref(), Some("is a list of 2; it must be each 0 to 1"));
        assert_eq!([0.0f32, 7.0, 1.0].problem(&THREE).as_deref(), Some("has an element that is 7; it must be 0 to 1"));
    }
}
