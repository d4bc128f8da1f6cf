//! The distribution function of the standard normal variable from plain arithmetic.

/// From here on the tail, 6e-16, is below the rounding.
const FAR: f64 = 8.0;
const INVERSE_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

/// The probability that a standard normal variable is below `x`, within 1e-13.
///
/// Marsaglia's series: 1/2 plus the density times `x + x^3/3 + x^5/(3·5) + ...`, whose terms all have one sign. It
/// needs only additions, multiplications and divisions, so every machine gets the same bits.
pub(super) fn normal_distribution(x: f64) -> f64 {
    if x < 0.0 {
        return 1.0 - normal_distribution(-x);
    }
    if x > FAR {
        return 1.0;
    }
    let square = x * x;
    let (mut term, mut sum, mut odd) = (x, x, 1.0);
    while term > 1e-17 * sum {
        odd += 2.0;
        term *= square / odd;
        sum += term;
    }
    0.5 + INVERSE_SQRT_TAU * exponential_decay(0.5 * square) * sum
}

/// `exp(-x)` for `x` in 0..=32: the Taylor polynomial at `x / 64`, squared six times. Relative error below 1e-13.
fn exponential_decay(x: f64) -> f64 {
    let small = x / 64.0;
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..=18 {
        term *= -small / f64::from(n);
        sum += term;
    }
    for _ in 0..6 {
        sum *= sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // From mpmath with 40 digits.
        for (x, expected) in [
            (0.0, 0.5),
            (0.5, 0.691_462_461_274_013_1),
            (1.0, 0.841_344_746_068_542_9),
            (-2.5, 0.006_209_665_325_776_135),
            (4.0, 0.999_968_328_758_166_9),
            (-5.5, 1.898_956_246_588_771_9e-8),
            (9.0, 1.0),
        ] {
            assert!((normal_distribution(x) - expected).abs() < 1e-13, "{x}: {}", normal_distribution(x));
        }
    }

    #[test]
    fn decay_is_accurate() {
        for i in 0..=320 {
            let x = f64::from(i) / 10.0;
            assert!((exponential_decay(x) / (-x).exp() - 1.0).abs() < 1e-13, "{x}");
        }
    }

    /// At the distance of neighboring edges of the widest row of the table, and as far as it reaches.
    #[test]
    fn it_rises() {
        let values: Vec<_> = (-1550..=1550).map(|i| normal_distribution(f64::from(i) / 256.0)).collect();
        assert!(values.is_sorted_by(|a, b| a < b));
    }
}
