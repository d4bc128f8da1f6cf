//! Exponential and logarithm from plain float32 arithmetic: the same bits on every machine.
//!
//! They use additions, multiplications, divisions and powers of two, which are put together from their bits. Both are
//! within 2 units in the last place of the true value. docs/format.md has the same constants and the same order.

use std::f32::consts::LOG2_E;

/// `ln 2` in two parts. The first has so few bits that its product with an exponent is exact.
const LN_2_HIGH: f32 = 0.693_359_4;
const LN_2_LOW: f32 = -2.121_944_4e-4;
/// Above this the exponential is no float32. Below the other bound it is replaced by 0.
const LARGEST: f32 = 88.722_83;
const LEAST: f32 = -40.0;
/// 1.5 · 2^23: adding and subtracting it rounds to a whole number, ties to even.
const ROUND: f32 = 12_582_912.0;
/// The exponential's series after `1 + r`: 1/2!, 1/3!, ... 1/7!.
const SERIES: [f32; 6] = [1.0 / 2.0, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0];
/// `sqrt(2)`: mantissas lie between half of it and it.
const SQRT_2: f32 = std::f32::consts::SQRT_2;

/// `2^k` for `k` in -126..=127.
#[inline(always)]
fn power_of_two(k: i32) -> f32 {
    f32::from_bits(((k + 127) as u32) << 23)
}

/// `exp(x)`: infinite above 88.72283, 0 below -40; NaN of NaN.
#[inline(always)]
pub(crate) fn exponential(x: f32) -> f32 {
    if x > LARGEST {
        return f32::INFINITY;
    }
    if x < LEAST {
        return 0.0;
    }
    if x.is_nan() {
        return x;
    }
    // x = k ln 2 + r
    let k = (x * LOG2_E + ROUND) - ROUND;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let series = SERIES.iter().rev().fold(0.0, |sum, &term| (sum + term) * r);
    // `k` may be 128, which no float32 has as its exponent.
    let half = power_of_two(k as i32 - 1);
    ((r + series * r) + 1.0) * half * 2.0
}

/// `ln(x)`: minus infinity at 0, NaN below.
#[inline(always)]
pub(crate) fn logarithm(x: f32) -> f32 {
    if x == 0.0 {
        return f32::NEG_INFINITY;
    }
    // The input is not subnormal (see `kept`), so the exponent can be read from its bits.
    if !(x > 0.0 && x.is_finite()) {
        return if x > 0.0 { x } else { f32::NAN };
    }
    let bits = x.to_bits();
    let mut exponent = (bits >> 23) as i32 - 127;
    let mut mantissa = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    if mantissa > SQRT_2 {
        mantissa *= 0.5;
        exponent += 1;
    }
    // ln m = 2 artanh(s) = 2 s (1 + s²/3 + s⁴/5 + ...)
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let square = s * s;
    let series = [1.0f32 / 11.0, 1.0 / 9.0, 1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0];
    let series = series.iter().fold(0.0, |sum, &term| (sum + term) * square);
    let exponent = exponent as f32;
    ((s + s * series) * 2.0 + exponent * LN_2_LOW) + exponent * LN_2_HIGH
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Difference in units of the last place of `expected`.
    fn units(found: f32, expected: f64) -> f64 {
        let unit = f64::from(f32::EPSILON) * 2f64.powi(expected.abs().log2().floor() as i32);
        (f64::from(found) - expected).abs() / unit
    }

    #[test]
    fn the_exponential_is_accurate() {
        let mut worst = 0.0f64;
        for i in -4_000_000..8_872_284 {
            let x = i as f32 * 1e-5;
            worst = worst.max(units(exponential(x), f64::from(x).exp()));
        }
        println!("{worst} units");
        assert!(worst <= 2.0, "{worst}");
        assert_eq!([0.0, -0.0, -40.1, 88.73].map(exponential), [1.0, 1.0, 0.0, f32::INFINITY]);
        assert!(exponential(LARGEST).is_finite() && units(exponential(LARGEST), f64::from(LARGEST).exp()) <= 2.0);
        assert_eq!([f32::INFINITY, f32::NEG_INFINITY].map(exponential), [f32::INFINITY, 0.0]);
        assert!(exponential(f32::NAN).is_nan());
    }

    #[test]
    fn the_logarithm_is_accurate() {
        let mut worst = 0.0f64;
        // Every exponent of numbers that are kept, and 1.
        for exponent in -50..128 {
            for i in 0..2048 {
                let x = (1.0 + i as f32 / 2048.0) * power_of_two(exponent);
                if x != 1.0 {
                    worst = worst.max(units(logarithm(x), f64::from(x).ln()));
                }
            }
        }
        // Around 1 the result is small.
        for i in 1..2_000_000 {
            let x = i as f32 * 1e-6;
            if x != 1.0 {
                worst = worst.max(units(logarithm(x), f64::from(x).ln()));
            }
        }
        println!("{worst} units");
        assert!(worst <= 2.0, "{worst}");
        assert_eq!(logarithm(1.0), 0.0);
        assert_eq!([0.0, -0.0, f32::INFINITY].map(logarithm), [f32::NEG_INFINITY, f32::NEG_INFINITY, f32::INFINITY]);
        assert!([f32::NAN, -1.0, f32::NEG_INFINITY].into_iter().all(|x| logarithm(x).is_nan()));
    }

    /// These bits must be the same on every machine.
    #[test]
    fn bits_are_those_of_every_machine() {
        let mut digest = 0u32;
        for i in -2000..2000 {
            let x = i as f32 * 0.02;
            digest = digest.rotate_left(5) ^ exponential(x).to_bits().wrapping_mul(0x9e37_79b9);
            digest = digest.rotate_left(5) ^ logarithm(x.abs() + 0.01).to_bits().wrapping_mul(0x9e37_79b9);
        }
        assert_eq!(digest, DIGEST, "{digest:#x}");
    }

    const DIGEST: u32 = 0xa821_e896;
}
