//! Which segments are drawn at a time, and the share of each: around a join, one segment fades into the next.

use super::{SegmentTimes, TakeIndex};
use crate::network::kernels::{exponential, logarithm};

/// The logits of opacities that are faded lie within ± this number.
const MOST_LOGIT: f32 = 80.0;

/// A segment that is drawn at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnSegment {
    /// Its number in time, from 0.
    pub segment: usize,
    /// Its share, in [0, 1]. Those of a time have the sum 1, but for rounding.
    pub weight: f32,
}

impl TakeIndex {
    /// The segments that are drawn at a time in seconds: none in a gap, two around a join, otherwise one.
    ///
    /// The fade from a segment to one that begins where it ends takes the time that both streams cover, within the halves of the two
    /// segments at the join. A gap, and a join without such a time, has none.
    pub fn drawn_at(&self, seconds: f64) -> Vec<DrawnSegment> {
        let Some(segment) = self.segment_at(seconds) else { return Vec::new() };
        let weight_of_later = |earlier: usize| {
            let [from, to] = self.fade(earlier)?;
            (from < seconds && seconds < to).then(|| (seconds - from) / (to - from))
        };
        // No time is within two fades, as none goes beyond the middle of a segment.
        for earlier in [Some(segment), segment.checked_sub(1)].into_iter().flatten() {
            if let Some(later) = weight_of_later(earlier) {
                let weights = [1.0 - later, later].map(|weight| weight as f32);
                return (earlier..).zip(weights).map(|(segment, weight)| DrawnSegment { segment, weight }).collect();
            }
        }
        vec![DrawnSegment { segment, weight: 1.0 }]
    }

    /// When a segment fades into the next one, in seconds.
    fn fade(&self, earlier: usize) -> Option<[f64; 2]> {
        let [earlier, later] = self.segments().get(earlier..earlier + 2)? else { return None };
        let [earlier, later] = [earlier.times, later.times];
        let middle = |times: SegmentTimes| 0.5 * (times.begin + times.end);
        (earlier.end == later.begin).then(|| {
            let from = later.stream_begin.max(middle(earlier));
            let to = earlier.stream_end.max(earlier.end).min(middle(later));
            [from, to]
        })
    }
}

/// The logit of the opacity `1 - (1 - o)^weight`, where `o` is the opacity of a logit. What two segments with weights of the
/// sum 1 have in common so stays as opaque as it is. docs/format.md has the order of the operations.
pub(super) fn faded(logit: f32, weight: f32) -> f32 {
    if weight == 1.0 {
        return logit;
    }
    // Written so that NaN becomes the least one.
    let logit = if logit > -MOST_LOGIT { logit.min(MOST_LOGIT) } else { -MOST_LOGIT };
    // -ln(1 - o)
    let density = logarithm(1.0 + exponential(logit));
    logarithm(exponential(weight * density) - 1.0).max(-MOST_LOGIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opacity(logit: f64) -> f64 {
        1.0 / (1.0 + (-logit).exp())
    }

    #[test]
    fn opacities_are_those_of_a_thinner_medium() {
        for weight in [0.001_f32, 0.06, 0.5, 0.9, 0.999] {
            for step in -60..=60 {
                let logit = 0.2 * step as f32;
                let found = opacity(faded(logit, weight).into());
                let expected = 1.0 - (1.0 - opacity(logit.into())).powf(weight.into());
                assert!((found - expected).abs() < 1e-6, "{logit}, {weight}: {found}, expected {expected}");
            }
        }
    }

    #[test]
    fn two_halves_are_as_opaque_as_the_whole() {
        for logit in [-3.0_f32, 0.0, 2.0, 8.0] {
            let [first, second] = [0.25, 0.75].map(|weight| 1.0 - opacity(faded(logit, weight).into()));
            assert!((first * second - (1.0 - opacity(logit.into()))).abs() < 1e-6, "{logit}");
        }
    }

    #[test]
    fn extremes_stay_finite() {
        for logit in [f32::NAN, f32::NEG_INFINITY, -1e30, -81.0, -50.0] {
            assert_eq!(faded(logit, 0.5), -80.0);
        }
        assert_eq!([80.0, 1e30, f32::INFINITY].map(|logit| faded(logit, 0.5)), [40.0; 3]);
        assert_eq!([faded(3.0, 0.0), faded(3.0, 1.0)], [-80.0, 3.0]);
    }
}
