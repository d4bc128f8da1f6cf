//! Numbers by names that the configuration does not know, such as those of a plug-in's attributes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{Bounds, KeyValue, Problem};

/// A key that is a table of numbers by name. A layer changes some of them, and may name more. Its bounds are
/// [`Bounds::ByName`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ByName(BTreeMap<String, f64>);

impl ByName {
    /// The number with a name.
    pub fn of(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// Sets the number with a name.
    pub fn set(&mut self, name: impl Into<String>, number: f64) {
        self.0.insert(name.into(), number);
    }

    /// Names and numbers, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, number)| (name.as_str(), *number))
    }
}

impl<N: Into<String>> FromIterator<(N, f64)> for ByName {
    fn from_iter<I: IntoIterator<Item = (N, f64)>>(numbers: I) -> Self {
        Self(numbers.into_iter().map(|(name, number)| (name.into(), number)).collect())
    }
}

impl KeyValue for ByName {
    fn check(&self, bounds: &Bounds, key: &str, into: &mut Vec<Problem>) {
        let Bounds::ByName(each) = bounds else { return };
        for (name, number) in self.iter() {
            number.check(each, &format!("{key}.{name}"), into);
        }
    }
}
