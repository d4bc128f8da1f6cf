//! The types that a key may have, and the check of a value against its bounds.

use std::path::PathBuf;

use crate::Bounds;

/// A type that a key may have.
pub trait KeyValue {
    /// What is wrong with the value, if it is out of bounds. A type whose every value is legal, such as that of a
    /// choice, does without.
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        let _ = bounds;
        None
    }
}

impl KeyValue for bool {}

impl KeyValue for PathBuf {}

impl KeyValue for String {
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        bounds.problem_of_text(self)
    }
}

macro_rules! numbers {
    ($($type:ty => $problem:ident as $wide:ty;)+) => {
        $(impl KeyValue for $type {
            fn problem(&self, bounds: &Bounds) -> Option<String> {
                bounds.$problem(*self as $wide)
            }
        })+
    };
}

numbers! {
    u8 => problem_of_whole as u64;
    u32 => problem_of_whole as u64;
    u64 => problem_of_whole as u64;
    usize => problem_of_whole as u64;
    f32 => problem_of_number as f64;
    f64 => problem_of_number as f64;
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
        bounds.problem_of_list(self)
    }
}

impl<T: KeyValue, const N: usize> KeyValue for [T; N] {
    fn problem(&self, bounds: &Bounds) -> Option<String> {
        bounds.problem_of_list(self)
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
