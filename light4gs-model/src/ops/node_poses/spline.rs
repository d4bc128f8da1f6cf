//! Uniform cubic B-splines over the scene's time: the trajectories of control nodes.

/// The four knots that have a weight at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spline {
    /// The first of them.
    pub(crate) first: usize,
    /// Their weights; they sum to 1.
    pub(crate) weights: [f32; 4],
}

impl Spline {
    /// At a time in [0, 1], of `knots` knots, 4 or more.
    pub(crate) fn at(time: f32, knots: usize) -> Self {
        let place = time * (knots - 3) as f32;
        let first = (place.max(0.0) as usize).min(knots - 4);
        // Knot k is in the middle of its piece at `place = k - 1`.
        let weight = |knot: usize| {
            let distance = (place + 1.0 - knot as f32).abs();
            let [outer, inner] = [2.0, 1.0].map(|end: f32| (end - distance).max(0.0).powi(3) / 6.0);
            outer - 4.0 * inner
        };
        Self { first, weights: std::array::from_fn(|k| weight(first + k)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_are_those_of_the_cubic() {
        for time in [0.0, 0.013, 0.5, 0.77, 1.0] {
            let spline = Spline::at(time, 9);
            assert!((spline.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{time}");
            // A spline through knots on a line is that line.
            let at = |k: usize| spline.weights[k] * (spline.first + k) as f32;
            let place: f32 = (0..4).map(at).sum();
            assert!((place - (time * 6.0 + 1.0)).abs() < 1e-5, "{time}: {place}");
        }
        assert_eq!(Spline::at(1.0, 4).first, 0);
        assert_eq!(Spline::at(1.0, 9).first, 5);
    }
}
