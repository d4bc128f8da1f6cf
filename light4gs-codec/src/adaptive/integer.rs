//! Signed integers as adaptive binary decisions.

use super::{AdaptiveBit, BitCoder};

/// Magnitudes below `2^ROWS` have adaptive leading digits; those of larger ones are close to uniform.
const ROWS: usize = 12;
/// Number of adaptive binary digits after the first one.
const LEADING: u32 = 3;

/// Codes signed integers whose distribution is not known beforehand.
///
/// A value is a zero flag, a sign, and its magnitude `m >= 1` as an Exp-Golomb code: `floor(log2 m)` in unary, then the
/// binary digits below the first. Flag, sign, unary part and the leading digits adapt, separately in each of the
/// caller's contexts (flag and sign may have contexts of their own); the other digits are written raw. So a value
/// takes few decisions whatever its size, and after some hundred values of a smooth distribution the code is within a
/// fraction of a percent of its entropy.
#[derive(Clone, Debug)]
pub(crate) struct AdaptiveInteger {
    signs: Vec<Sign>,
    magnitudes: Vec<Magnitude>,
}

/// A context index for an expected magnitude: two levels an octave; 0 for 0, the last one for all large magnitudes.
///
/// ```text
/// magnitude  0  1  2  3  4..6  6..8  8..12  12..16 ...
/// level      0  1  3  4   5     6      7      8    ...
/// ```
#[inline]
pub(crate) fn magnitude_level(magnitude: u64, last: usize) -> usize {
    let level = match magnitude.checked_ilog2() {
        None => 0,
        Some(0) => 1,
        Some(octave) => 2 * octave as usize + 1 + (magnitude >> (octave - 1) & 1) as usize,
    };
    level.min(last)
}

#[derive(Clone, Debug, Default)]
struct Sign {
    zero: AdaptiveBit,
    negative: AdaptiveBit,
}

#[derive(Clone, Debug, Default)]
struct Magnitude {
    /// `longer[e]`: the magnitude is at least `2^(e + 1)`, given that it is at least `2^e`.
    longer: [AdaptiveBit; 31],
    /// The leading digits of magnitudes in `2^e..2^(e + 1)`, as a binary tree with its root at 1.
    leading: [[AdaptiveBit; 1 << LEADING]; ROWS],
}

impl AdaptiveInteger {
    /// A coder with `contexts` independent statistics.
    pub(crate) fn new(contexts: usize) -> Self {
        Self::with_signs(contexts, contexts)
    }

    /// As [`AdaptiveInteger::new`], with another number of statistics for flag and sign.
    pub(crate) fn with_signs(contexts: usize, signs: usize) -> Self {
        Self { signs: vec![Sign::default(); signs], magnitudes: vec![Magnitude::default(); contexts] }
    }

    /// Codes one value under the statistics of one context. Symmetric, see [`BitCoder::bit`].
    ///
    /// # Panics
    /// Where the context is not below the number of contexts.
    pub(crate) fn code(&mut self, coder: &mut impl BitCoder, context: usize, value: i32) -> i32 {
        self.code_with_sign(coder, context, context, value)
    }

    /// As [`AdaptiveInteger::code`], with a context of its own for flag and sign.
    pub(crate) fn code_with_sign(&mut self, coder: &mut impl BitCoder, context: usize, sign: usize, value: i32) -> i32 {
        let sign = &mut self.signs[sign];
        if sign.zero.code(coder, value == 0) {
            return 0;
        }
        let negative = sign.negative.code(coder, value < 0);
        let magnitude = self.magnitudes[context].code(coder, value.unsigned_abs());
        // Hostile bytes may hold a magnitude of 2^31 and more, which then wraps.
        if negative { magnitude.wrapping_neg() as i32 } else { magnitude as i32 }
    }
}

impl Magnitude {
    /// Codes `magnitude`, which is not 0. A decoder may pass any value.
    #[inline]
    fn code(&mut self, coder: &mut impl BitCoder, magnitude: u32) -> u32 {
        let exponent = magnitude.checked_ilog2().unwrap_or(0);
        let mut digits = 0;
        while let Some(longer) = self.longer.get_mut(digits as usize)
            && longer.code(coder, exponent > digits)
        {
            digits += 1;
        }

        let leading = if (digits as usize) < ROWS { digits.min(LEADING) } else { 0 };
        let raw = digits - leading;
        let mut node = 1;
        if leading > 0 {
            let tree = &mut self.leading[digits as usize];
            for level in (0..leading).rev() {
                let digit = tree[node].code(coder, magnitude >> (raw + level) & 1 == 1);
                node = 2 * node + usize::from(digit);
            }
        }
        // The root stands for the first digit, so the node is the leading part of the magnitude.
        (node as u32) << raw | coder.raw(raw, magnitude & ((1 << raw) - 1))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::adaptive::{BitDecoder, BitEncoder};

    fn code(coder: &mut impl BitCoder, values: &mut [i32]) {
        let mut integers = AdaptiveInteger::new(3);
        for (index, value) in values.iter_mut().enumerate() {
            *value = integers.code(coder, index % 3, *value);
        }
    }

    fn round_trip(values: &[i32]) -> (Vec<i32>, usize) {
        let mut encoder = BitEncoder::default();
        code(&mut encoder, &mut values.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![0; values.len()];
        let mut decoder = BitDecoder::new(&bytes);
        code(&mut decoder, &mut decoded);
        assert_eq!(decoder.check(), Ok(()));
        (decoded, bytes.len())
    }

    proptest! {
        #[test]
        fn any_integers_come_back(values in prop::collection::vec(
            prop_oneof![-3..=3, -300..=300, any::<i32>(), Just(i32::MIN), Just(i32::MAX)], 0..300))
        {
            prop_assert_eq!(round_trip(&values).0, values);
        }

        #[test]
        fn any_bytes_decode_to_something(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            code(&mut BitDecoder::new(&bytes), &mut [0; 300]);
        }
    }

    /// Rounded Laplace variables of a known entropy, from a fixed stream of numbers.
    #[test]
    fn a_smooth_distribution_costs_its_entropy() {
        let count = 60_000;
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((state >> 33) as f64 + 0.5) / f64::from(1_u32 << 31)
        };
        for spread in [0.3, 2.0, 15.0, 200.0] {
            let values: Vec<i32> = (0..count).map(|_| (spread * (uniform() / uniform()).ln()).round() as i32).collect();
            let mut histogram = std::collections::BTreeMap::new();
            for value in &values {
                *histogram.entry(value).or_insert(0) += 1;
            }
            let entropy: f64 =
                histogram.values().map(|&n| f64::from(n) * (f64::from(count) / f64::from(n)).log2()).sum();
            let (decoded, bytes) = round_trip(&values);
            assert_eq!(decoded, values);
            let bits = 8.0 * bytes as f64;
            assert!(bits < 1.02 * entropy + 2000.0, "{bits} bits, entropy {entropy}");
        }
    }
}
