//! Times of a scene are shares of the whole. With a rate of frames they become seconds.

/// The different times, rising.
pub(crate) fn different(times: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut times: Vec<f32> = times.collect();
    times.sort_by(f32::total_cmp);
    times.dedup();
    times
}

/// The median of the steps between different, rising times; `None` for fewer than two.
pub(crate) fn usual_step(times: &[f32]) -> Option<f32> {
    let mut steps: Vec<f32> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f32::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// Seconds from time 0 to time 1, where different, rising times are those of frames at a rate, frames per second.
pub(crate) fn seconds_at_rate(times: &[f32], rate: f64) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    let span = f64::from(*last) - f64::from(*first);
    (span > 0.0).then(|| (times.len() - 1) as f64 / (rate * span))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_makes_seconds_of_shares() {
        let whole = different([0.5, 0.0, 1.0, 0.5].into_iter());
        assert_eq!(whole, [0.0, 0.5, 1.0]);
        assert_eq!((seconds_at_rate(&whole, 2.0), usual_step(&whole)), (Some(1.0), Some(0.5)));
        // Frame i of 4 has time i / 4: the whole has 4 intervals.
        assert_eq!(seconds_at_rate(&[0.0, 0.25, 0.5, 0.75], 2.0), Some(2.0));
        assert_eq!((seconds_at_rate(&[0.5], 2.0), usual_step(&[0.5])), (None, None));
        assert_eq!((seconds_at_rate(&[], 2.0), usual_step(&[])), (None, None));
    }
}
