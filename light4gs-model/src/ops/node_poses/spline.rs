//! Uniform cubic B-splines over the scene's time: the trajectories of control nodes.

/// The four knots that have a weight at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spline {
    /// The first of them.
    pub(crate) first: usize,
    /// Their weights; they sum to 1.
    pub(crate) weights: [f32; 4],
}

/// What the first and the last knot of a trajectory are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Numbers of their own.
    Free,
    /// On the line through the two knots next to them, whatever they are: the spline does not bend at its ends. Only a few
    /// times have a view that depends on these knots.
    Natural,
}

impl Spline {
    /// At a time in [0, 1], of `knots` knots, 4 or more.
    pub(crate) fn at(time: f32, knots: usize, ends: Ends) -> Self {
        let free = Self::with_free_ends(time, knots);
        if ends == Ends::Free {
            return free;
        }
        let Self { first, weights: [mut a, mut b, mut c, mut d] } = free;
        // The weight of the knot at an end goes to those on its line.
        let (at_begin, at_end) = (first == 0, first + 4 == knots);
        let (begin, end) = (if at_begin { a } else { 0.0 }, if at_end { d } else { 0.0 });
        if at_begin {
            (a, b, c) = (0.0, b + 2.0 * begin, c - begin);
        }
        if at_end {
            (b, c, d) = (b - end, c + 2.0 * end, 0.0);
        }
        Self { first, weights: [a, b, c, d] }
    }

    fn with_free_ends(time: f32, knots: usize) -> Self {
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
            let spline = Spline::at(time, 9, Ends::Free);
            assert!((spline.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{time}");
            // A spline through knots on a line is that line.
            let at = |k: usize| spline.weights[k] * (spline.first + k) as f32;
            let place: f32 = (0..4).map(at).sum();
            assert!((place - (time * 6.0 + 1.0)).abs() < 1e-5, "{time}: {place}");
        }
        assert_eq!(Spline::at(1.0, 4, Ends::Free).first, 0);
        assert_eq!(Spline::at(1.0, 9, Ends::Free).first, 5);
    }

    #[test]
    fn natural_ends_are_on_the_line_of_their_neighbors() {
        for knots in [4, 5, 9] {
            let free: Vec<f32> = (0..knots).map(|k| ((k * k) as f32).sin()).collect();
            let mut natural = free.clone();
            natural[0] = 2.0 * free[1] - free[2];
            natural[knots - 1] = 2.0 * free[knots - 2] - free[knots - 3];
            let at = |values: &[f32], spline: Spline| -> f32 {
                (0..4).map(|k| spline.weights[k] * values[spline.first + k]).sum()
            };
            for time in [0.0, 0.04, 0.13, 0.5, 0.93, 1.0] {
                let found = at(&free, Spline::at(time, knots, Ends::Natural));
                let expected = at(&natural, Spline::at(time, knots, Ends::Free));
                assert!((found - expected).abs() < 1e-5, "{knots} knots, {time}: {found}, not {expected}");
            }
        }
    }
}
