//! Mean and standard deviation over runs that differ only in their seed.

use serde::Serialize;

/// Mean and standard deviation of repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Number of measurements.
    pub count: usize,
    /// Mean; NaN if there are none.
    pub mean: f64,
    /// Sample standard deviation (divided by `count - 1`); `None` for fewer than two.
    pub deviation: Option<f64>,
}

impl Spread {
    /// From finite values.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count as f64;
        let deviation = (count > 1).then(|| {
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            (squares / (count - 1) as f64).sqrt()
        });
        Self { count, mean, deviation }
    }

    /// Whether the magnitude of the mean is at most the standard deviation. `None` for fewer than two.
    pub fn is_within_deviation(&self) -> Option<bool> {
        self.deviation.map(|deviation| self.mean.abs() <= deviation)
    }

    /// `12.34 ± 0.05`, with this many digits after the point.
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
    fn small_means_are_within_the_deviation() {
        assert_eq!(Spread::of(&[-1.0, 0.5, 1.0]).is_within_deviation(), Some(true));
        assert_eq!(Spread::of(&[2.0, 3.0, 2.5]).is_within_deviation(), Some(false));
        assert_eq!(Spread::of(&[2.0]).is_within_deviation(), None);
    }
}
