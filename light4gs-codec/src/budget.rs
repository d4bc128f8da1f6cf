//! Memory and time that decoding takes: both are added up before they are taken.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::{CodecError, Limits, limits::at_most};

/// Memory for descriptions, tables, names and messages together; limits of their own bound their counts.
const SMALL_THINGS: u64 = 16 << 20;
/// Nanoseconds for each byte of a stream, besides those for counts and sizes: a byte may hold several decisions.
const NANOSECONDS_A_BYTE: u64 = 60;

/// The memory and the time that the parts of a stream have asked for so far. Nothing is given back, since the order of
/// the parts must not decide whether a stream is refused.
#[derive(Debug)]
pub(crate) struct Budget {
    pub(crate) limits: Limits,
    memory: AtomicU64,
    nanoseconds: AtomicU64,
    exhausted: AtomicBool,
}

impl Budget {
    /// A budget from which only the fixed amount is taken.
    pub(crate) fn new(limits: &Limits) -> Self {
        Self::resumed(limits, Demand { memory_bytes: SMALL_THINGS, nanoseconds: 0 })
    }

    /// A budget after other parts of the stream, which have `spent` what [`Budget::demand`] returned.
    pub(crate) fn resumed(limits: &Limits, spent: Demand) -> Self {
        let Demand { memory_bytes, nanoseconds } = spent;
        Self {
            limits: *limits,
            memory: AtomicU64::new(memory_bytes.max(SMALL_THINGS)),
            nanoseconds: AtomicU64::new(nanoseconds),
            exhausted: AtomicBool::new(false),
        }
    }

    /// Asks for memory.
    pub(crate) fn memory(&self, section: &'static str, bytes: u64) -> Result<(), CodecError> {
        let field = "memory that decoding takes in bytes";
        self.within(at_most(section, field, spend(&self.memory, bytes), self.limits.memory_bytes))
    }

    /// Asks for time.
    pub(crate) fn time(&self, section: &'static str, nanoseconds: u64) -> Result<(), CodecError> {
        let field = "time that decoding takes in nanoseconds";
        self.within(at_most(section, field, spend(&self.nanoseconds, nanoseconds), self.limits.nanoseconds))
    }

    fn within(&self, answer: Result<(), CodecError>) -> Result<(), CodecError> {
        self.exhausted.fetch_or(answer.is_err(), Ordering::Relaxed);
        answer
    }

    /// Whether more was asked for than there is. A longer stream may ask for more.
    pub(crate) fn is_exhausted(&self) -> bool {
        self.exhausted.load(Ordering::Relaxed)
    }

    /// Asks for the memory of `count` things of a number of bytes each, and for the time to make them.
    pub(crate) fn things(
        &self,
        section: &'static str,
        count: u64,
        bytes: u64,
        nanoseconds: u64,
    ) -> Result<(), CodecError> {
        self.memory(section, count.saturating_mul(bytes))?;
        self.time(section, count.saturating_mul(nanoseconds))
    }

    /// Asks for the memory and time of reading an entropy-coded stream.
    pub(crate) fn stream(&self, section: &'static str, bytes: usize) -> Result<(), CodecError> {
        self.things(section, bytes as u64, 1, NANOSECONDS_A_BYTE)
    }

    /// What was asked for.
    pub(crate) fn demand(&self) -> Demand {
        let (memory, nanoseconds) = (self.memory.load(Ordering::Relaxed), self.nanoseconds.load(Ordering::Relaxed));
        Demand { memory_bytes: memory, nanoseconds }
    }
}

/// What a reader must allow to decode a stream: see [`Limits::memory_bytes`] and [`Limits::nanoseconds`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Demand {
    /// Memory in bytes, added up beforehand.
    pub memory_bytes: u64,
    /// Nanoseconds on one thread, added up beforehand.
    pub nanoseconds: u64,
}

/// Adds without overflow, and returns the sum.
fn spend(spent: &AtomicU64, more: u64) -> u64 {
    let add = |spent: u64| spent.saturating_add(more);
    // The closure always gives a number.
    let before = spent.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |spent| Some(add(spent)));
    add(before.unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_overflow() {
        let budget = Budget::new(&Limits::default());
        assert!(budget.time("here", 1).is_ok());
        assert!(budget.memory("here", u64::MAX).is_err());
        assert!(budget.memory("here", 1).is_err());
        assert!(budget.time("here", u64::MAX).unwrap_err().to_string().starts_with("here: time"));
    }
}
