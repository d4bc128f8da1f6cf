//! Mean and spread over runs that differ in their seed alone.

use serde::Serialize;

/// Of some measurements of one thing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Mean; NaN of none.
    pub mean: f64,
    /// Sample standard deviation (divided by `count - 1`); None of less than two.
    pub deviation: Option<f64>,
}

impl Spread {
    /// Of finite values.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count as f64;
        let deviation = (count > 1).then(|| {
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            (squares / (count - 1) as f64).sqrt()
        });
        Self { count, mean, deviation }
    }

    /// Whether the difference to another mean is smaller than what seeds alone make: than the larger of both deviations.
    /// None where neither was measured.
    pub fn within_spread_of(&self, other: &Self) -> Option<bool> {
        let deviation = match (self.deviation, other.deviation) {
            (Some(a), Some(b)) => a.max(b),
            (Some(a), None) | (None, Some(a)) => a,
            (None, None) => return None,
        };
        Some((self.mean - other.mean).abs() < deviation)
    }

    /// `12.34 ± 0.05`, with so many digits after the point.
    pub fn to_text(&self, digits: usize) -> String {
        match self.deviation {
            Some(deviation) => format!("{:.digits$} ± {deviation:.digits$}", self.mean),
            None => format!("{:.digits$}", self.mean),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_known_values() {
        let spread = Spread::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
        assert_eq!(spread.mean, 5.0);
        assert!((spread.deviation.unwrap() - (32.0f64 / 7.0).sqrt()).abs() < 1e-12);
        assert_eq!(spread.to_text(2), "5.00 ± 2.14");
        assert_eq!(Spread::of(&[3.0]).to_text(1), "3.0");
        assert!(Spread::of(&[]).mean.is_nan());
    }

    #[test]
    fn small_differences_are_within_the_spread() {
        let a = Spread::of(&[1.0, 2.0, 3.0]);
        assert_eq!(a.within_spread_of(&Spread::of(&[2.5])), Some(true));
        assert_eq!(a.within_spread_of(&Spread::of(&[4.0])), Some(false));
        assert_eq!(Spread::of(&[1.0]).within_spread_of(&Spread::of(&[4.0])), None);
    }
}
