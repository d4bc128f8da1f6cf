//! A binary decision whose probability adapts.

use super::range_coder::{BitCoder, Probability};

/// Observations after which the fast estimate begins to forget.
const FAST: u8 = 18;
/// Observations after which the slow estimate begins to forget.
const SLOW: u8 = 250;

/// `RATES[n]` is the weight, in units of 2^-16, of one observation after `n` others.
const RATES: [u16; SLOW as usize + 1] = {
    let mut rates = [0; SLOW as usize + 1];
    let mut n = 0;
    while n < rates.len() {
        // 1 / (n + 3/2): between the mean of all observations (Laplace) and the last one alone.
        rates[n] = (2 * 65536 / (2 * n + 3)) as u16;
        n += 1;
    }
    rates
};

/// The probability of a binary decision, learned from the decisions before it.
///
/// Two estimates are averaged. At first both are the mean of all observations. Later one has a window of some 20
/// observations, the other of some 250. The first follows changes, the second is precise where nothing changes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdaptiveBit {
    fast: u16,
    slow: u16,
    observations: u8,
}

impl Default for AdaptiveBit {
    fn default() -> Self {
        Self { fast: 1 << 15, slow: 1 << 15, observations: 0 }
    }
}

impl AdaptiveBit {
    /// Codes one decision and learns from it.
    #[inline]
    pub(crate) fn code(&mut self, coder: &mut impl BitCoder, bit: bool) -> bool {
        let one = Probability::new((u32::from(self.fast) + u32::from(self.slow)) >> 2);
        let bit = coder.bit(one, bit);
        self.learn(bit);
        bit
    }

    #[inline]
    fn learn(&mut self, bit: bool) {
        let target = if bit { i64::from(u16::MAX) } else { 0 };
        let moved = |estimate: u16, observations: u8| {
            let estimate = i64::from(estimate);
            // Between the estimate and the target, so it fits.
            (estimate + (((target - estimate) * i64::from(RATES[usize::from(observations)])) >> 16)) as u16
        };
        self.fast = moved(self.fast, self.observations.min(FAST));
        self.slow = moved(self.slow, self.observations);
        self.observations = (self.observations + 1).min(SLOW);
    }
}
