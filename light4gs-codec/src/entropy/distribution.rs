//! A distribution of integers as cumulative frequencies.

use std::{borrow::Borrow, num::NonZeroU32};

use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};

/// The frequencies of a distribution sum to `2^TOTAL_BITS`.
pub(crate) const TOTAL_BITS: usize = 24;
const TOTAL: u32 = 1 << TOTAL_BITS;
/// Upper bits of a quantile that index [`Distribution::search`].
const SEARCH_BITS: usize = 8;

/// Frequencies of `first`, `first + 1`, ... and of the escape slot, which stands for all other integers.
///
/// Every slot has a frequency of at least 1.
#[derive(Clone, Debug)]
pub(crate) struct Distribution {
    pub(super) first: i32,
    /// Slot `i` holds the quantiles `cumulative[i]..cumulative[i + 1]`; the escape is the last slot.
    cumulative: Vec<u32>,
    /// `search[b]` is the slot of the quantile `b << 16`, for every `b` up to and including 256.
    search: Vec<u16>,
}

impl Distribution {
    /// From the left ends of the slots, which begin at 0 and rise strictly, all below 2^24.
    pub(super) fn new(first: i32, mut starts: Vec<u32>) -> Self {
        starts.push(TOTAL);
        debug_assert!(starts[0] == 0 && starts.is_sorted_by(|a, b| a < b) && starts.len() <= 1 << 16);
        let mut search = Vec::with_capacity((1 << SEARCH_BITS) + 1);
        let mut slot = 0;
        for bucket in 0..=1u32 << SEARCH_BITS {
            let quantile = (bucket << (TOTAL_BITS - SEARCH_BITS)).min(TOTAL - 1);
            while starts[slot + 1] <= quantile {
                slot += 1;
            }
            search.push(slot as u16);
        }
        Self { first, cumulative: starts, search }
    }

    /// The slot for the integers that have no slot of their own.
    pub(super) fn escape(&self) -> usize {
        self.cumulative.len() - 2
    }

    /// The slot of an integer.
    pub(super) fn slot(&self, value: i32) -> usize {
        let index = i64::from(value) - i64::from(self.first);
        if (0..self.escape() as i64).contains(&index) { index as usize } else { self.escape() }
    }

    fn frequency(&self, slot: usize) -> u32 {
        self.cumulative[slot + 1] - self.cumulative[slot]
    }

    /// Bits that a symbol takes, without the digits that follow an escape.
    pub(super) fn bits(&self, value: i32) -> f64 {
        TOTAL_BITS as f64 - f64::from(self.frequency(self.slot(value))).log2()
    }
}

/// Parameters of the Gaussians under which values are coded, in units of the quantization step.
#[derive(Clone, Debug, PartialEq)]
pub struct Distributions {
    /// Standard deviations as the networks give them. Values below 0.11 are raised to it when they are used.
    pub scales: Vec<f32>,
    /// Means.
    pub means: Vec<f32>,
}

impl EntropyModel<TOTAL_BITS> for &Distribution {
    type Symbol = usize;
    type Probability = u32;
}

impl EncoderModel<TOTAL_BITS> for &Distribution {
    #[inline]
    fn left_cumulative_and_probability(&self, slot: impl Borrow<usize>) -> Option<(u32, NonZeroU32)> {
        let slot = *slot.borrow();
        Some((self.cumulative[slot], NonZeroU32::new(self.frequency(slot))?))
    }
}

impl DecoderModel<TOTAL_BITS> for &Distribution {
    #[inline]
    fn quantile_function(&self, quantile: u32) -> (usize, u32, NonZeroU32) {
        let bucket = (quantile >> (TOTAL_BITS - SEARCH_BITS)) as usize;
        let (mut low, mut high) = (self.search[bucket] as usize, self.search[bucket + 1] as usize);
        while low < high {
            let middle = (low + high).div_ceil(2);
            if self.cumulative[middle] <= quantile { low = middle } else { high = middle - 1 }
        }
        let frequency = NonZeroU32::new(self.frequency(low)).expect("starts rise strictly");
        (low, self.cumulative[low], frequency)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantile_finds_its_slot() {
        let starts = vec![0, 1, 2, 70_000, 70_001, 9_000_000, TOTAL - 1];
        let distribution = Distribution::new(-2, starts.clone());
        let around =
            starts.iter().flat_map(|&start| [start.saturating_sub(1), start, start + 1]).chain([65_535, 65_536]);
        for quantile in around.filter(|&quantile| quantile < TOTAL) {
            let expected = starts.partition_point(|&start| start <= quantile) - 1;
            assert_eq!((&distribution).quantile_function(quantile).0, expected, "{quantile}");
        }
        assert_eq!((distribution.slot(-2), distribution.slot(3), distribution.slot(4)), (0, 5, 6));
        assert_eq!((distribution.slot(-3), distribution.slot(i32::MIN)), (6, 6));
    }
}
