//! Times as a capture's files give them, in whatever unit, as times in `[0, 1]`.

use crate::error::DataError;
use std::fmt;
use std::path::Path;

/// Times in `[0, 1]` that are closer than this are the same: captures have some thousands of frames.
const RESOLUTION: f64 = 1e-6;

/// The first time of a capture becomes 0, the last one 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::layouts) struct TimeRange {
    first: f64,
    span: f64,
}

impl TimeRange {
    /// The range of finite times that `path` gives in `field`.
    ///
    /// # Errors
    /// [`DataError::Field`] where the times lie so unevenly that more than half of the different ones would become the same:
    /// one of them is in another unit, say, or far away by mistake.
    pub(in crate::layouts) fn of(path: &Path, field: &str, times: &[f64]) -> Result<Self, DataError> {
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        let last = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let range = Self { first, span: last - first };
        let given = different(times.iter().copied());
        let kept = different(times.iter().map(|time| (range.at(*time) / RESOLUTION).round()));
        if 2 * kept < given {
            let problem = format!("of {given} different times from {first} to {last}, {kept} are left between 0 and 1");
            let remedy = "give all times in one unit, and correct those that lie far from the others";
            return Err(DataError::field(path, field, problem, remedy));
        }
        Ok(range)
    }

    /// A time in `[0, 1]`: 0 where all times are the same. One outside the range becomes its nearer end.
    pub(in crate::layouts) fn at(self, time: f64) -> f64 {
        if self.span > 0.0 { ((time - self.first) / self.span).clamp(0.0, 1.0) } else { 0.0 }
    }
}

impl fmt::Display for TimeRange {
    /// The first and the last time, as the capture's files have them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.first, self.first + self.span)
    }
}

fn different(times: impl Iterator<Item = f64>) -> usize {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapped(times: &[f64]) -> Vec<f64> {
        let range = TimeRange::of(Path::new("a.json"), "time", times).unwrap();
        times.iter().map(|time| range.at(*time)).collect()
    }

    #[test]
    fn any_unit_and_any_beginning_give_the_same_times() {
        let expected = [0.0, 0.25, 0.5, 1.0];
        let seconds = [0.0, 0.5, 1.0, 2.0];
        let epoch = 1_764_300_000.0;
        assert_eq!(mapped(&expected), expected);
        assert_eq!(mapped(&seconds), expected);
        assert_eq!(mapped(&seconds.map(|time| 1e3 * time)), expected);
        assert_eq!(mapped(&seconds.map(|time| epoch + time)), expected);
        // The distance of two numbers near 1.76e18 is 256 ns.
        for (time, expected) in mapped(&seconds.map(|time| 1e9 * (epoch + time))).into_iter().zip(expected) {
            assert!((time - expected).abs() < 1e-6, "{time}, expected {expected}");
        }
        assert_eq!(mapped(&[1000.0, 1005.0, 1015.0]), [0.0, 1.0 / 3.0, 1.0]);
        assert_eq!(mapped(&[7.0, 7.0]), [0.0, 0.0]);
    }

    #[test]
    fn what_is_outside_the_range_becomes_its_end() {
        let range = TimeRange::of(Path::new("a.json"), "time", &[2.0, 4.0]).unwrap();
        assert_eq!([1.0, 2.0, 5.0].map(|time| range.at(time)), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn times_that_would_become_the_same_are_refused() {
        let mut times: Vec<f64> = (0..100).map(f64::from).collect();
        times.push(1e12);
        let error = TimeRange::of(Path::new("a.json"), "frames[].time", &times).unwrap_err().to_string();
        assert!(
            ["a.json", "frames[].time", "of 101 different times", "in one unit"]
                .iter()
                .all(|part| error.contains(part)),
            "{error}"
        );
        // Two cameras whose clocks differ by rounding.
        let pairs: Vec<f64> = (0..50).flat_map(|k| [f64::from(k), f64::from(k) + 1e-12]).collect();
        assert!(TimeRange::of(Path::new("a.json"), "time", &pairs).is_ok());
    }
}
