//! Coding a sorted set of Morton codes.
//!
//! The set is split into halves of space, one bit of the code at a time. Coded is how many of a node's points fall into
//! its lower half (the splitting of Devillers and Gandoin, *Geometric compression for interactive transmission*, 2000).
//! Because the order of the points is free, this takes `log2 N!` bits less than coding them one by one, and the counts
//! adapt to how points cluster on surfaces. For a point that is alone in its node there is nothing to predict from, so
//! its other bits are written raw. Points in the same cell need no special treatment.
//!
//! On three of four trained scenes this takes about 1 % less than Morton deltas under adaptive Golomb codes with
//! contexts, on the fourth 0.4 % more.

use crate::adaptive::{AdaptiveBit, AdaptiveInteger, BitCoder, Damaged};

/// Nodes with fewer points have their own statistics for every count.
const FEW: usize = 16;

/// Codes ascending `codes` of `bits` bits. Symmetric: when decoding, the codes must be zeros.
pub(super) fn code(coder: &mut impl BitCoder, codes: &mut [u64], bits: u32) -> Result<(), Damaged> {
    Splits::new().node(coder, codes, bits)
}

/// The statistics of splits. Each axis has its own, since the points are seldom spread alike along all three.
struct Splits {
    /// `few[axis][n][k]`: whether the lower half of `n` points has the `k`-th count of [`from_the_ends`].
    few: [Vec<[AdaptiveBit; FEW]>; 3],
    /// By the number of binary digits of the count: whether all points are in the lower half, whether all are in the
    /// upper.
    one_sided: [[AdaptiveBit; 2]; usize::BITS as usize + 1],
    /// By the number of binary digits of the count: the points in the lower half, minus half of all.
    uneven: AdaptiveInteger,
}

impl Splits {
    fn new() -> Self {
        Self {
            few: std::array::from_fn(|_| vec![Default::default(); FEW]),
            one_sided: [Default::default(); usize::BITS as usize + 1],
            uneven: AdaptiveInteger::new(usize::BITS as usize + 1),
        }
    }

    /// Codes the lowest `bits` bits of `codes`, which agree in all higher ones.
    fn node(&mut self, coder: &mut impl BitCoder, codes: &mut [u64], bits: u32) -> Result<(), Damaged> {
        coder.check()?;
        if bits == 0 {
            return Ok(());
        }
        match codes {
            [] => Ok(()),
            [alone] => {
                let low = bits.min(32);
                *alone |= u64::from(coder.raw(low, *alone as u32 & low_bits(low)));
                let high = bits - low;
                *alone |= u64::from(coder.raw(high, (*alone >> 32) as u32 & low_bits(high))) << 32;
                Ok(())
            }
            _ => {
                let bit = 1 << (bits - 1);
                let lower = codes.partition_point(|code| code & bit == 0);
                let lower = self.lower_half(coder, codes.len(), bits as usize % 3, lower);
                let (lower, upper) = codes.split_at_mut(lower);
                upper.iter_mut().for_each(|code| *code |= bit);
                self.node(coder, lower, bits - 1)?;
                self.node(coder, upper, bits - 1)
            }
        }
    }

    /// Codes how many of `count` points are in the lower half.
    fn lower_half(&mut self, coder: &mut impl BitCoder, count: usize, axis: usize, lower: usize) -> usize {
        if count < FEW {
            let statistics = &mut self.few[axis][count];
            return (0..count)
                .find(|&k| statistics[k].code(coder, lower == from_the_ends(k, count)))
                .map_or(from_the_ends(count, count), |k| from_the_ends(k, count));
        }
        let size = (usize::BITS - count.leading_zeros()) as usize;
        let [all_lower, all_upper] = &mut self.one_sided[size];
        if all_lower.code(coder, lower == count) {
            return count;
        }
        if all_upper.code(coder, lower == 0) {
            return 0;
        }
        let half = (count / 2) as i64;
        let uneven = self.uneven.code(coder, size, (lower as i64 - half) as i32);
        (half + i64::from(uneven)).clamp(0, count as i64) as usize
    }
}

/// The counts `0..=count`, the most one-sided first: 0, `count`, 1, `count - 1`, ...
fn from_the_ends(k: usize, count: usize) -> usize {
    if k.is_multiple_of(2) { k / 2 } else { count - k / 2 }
}

fn low_bits(bits: u32) -> u32 {
    ((1_u64 << bits) - 1) as u32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::adaptive::{BitDecoder, BitEncoder};

    fn round_trip(codes: &[u64], bits: u32) -> usize {
        let mut encoder = BitEncoder::default();
        code(&mut encoder, &mut codes.to_vec(), bits).unwrap();
        let bytes = encoder.finish();
        let mut decoded = vec![0; codes.len()];
        code(&mut BitDecoder::new(&bytes), &mut decoded, bits).unwrap();
        assert_eq!(decoded, codes);
        bytes.len()
    }

    proptest! {
        #[test]
        fn any_set_comes_back(mut codes in prop::collection::vec(any::<u64>(), 0..200), bits in 0..=60_u32) {
            codes.iter_mut().for_each(|code| *code &= (1 << bits) - 1);
            codes.sort_unstable();
            round_trip(&codes, bits);
        }

        #[test]
        fn any_bytes_end(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            let mut codes = [0; 300];
            let _ = code(&mut BitDecoder::new(&bytes), &mut codes, 60);
            prop_assert!(codes.is_sorted());
        }
    }

    /// The information of a set of uniform points is `log2 C(2^bits + n - 1, n)` bits.
    #[test]
    fn uniform_points_cost_their_information() {
        let (count, bits) = (10_000_u32, 36);
        let mut codes: Vec<u64> = (0..u64::from(count))
            .map(|i| {
                i.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31).wrapping_mul(0xd6e8_feb8_6659_fd93) >> (64 - bits)
            })
            .collect();
        codes.sort_unstable();
        let bound = f64::from(count * bits) - (1..=count).map(|n| f64::from(n).log2()).sum::<f64>();
        let spent = 8.0 * round_trip(&codes, bits) as f64;
        assert!(spent < 1.01 * bound, "{spent} bits, bound {bound}");
    }
}
