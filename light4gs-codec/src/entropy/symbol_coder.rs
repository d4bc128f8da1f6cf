//! Integers into bytes and back: `constriction`'s ANS coder under [`Distribution`]s.

use std::{borrow::Borrow, num::NonZeroU32};

use constriction::{
    UnwrapInfallible,
    stream::{
        Decode, Encode,
        model::{DecoderModel, EncoderModel, EntropyModel},
        stack::DefaultAnsCoder,
    },
};

use super::{Distribution, SYMBOL_LIMIT, TOTAL_BITS};
use crate::adaptive::Damaged;

/// Most zeros before the digits of an escaped symbol.
const MOST_ZEROS: u32 = 23;

/// Codes integers, in either direction.
pub(crate) trait SymbolCoder {
    /// Codes one symbol under `distributions[table]`. When encoding, the symbol that `wanted` returns is remembered and
    /// returned. When decoding, `wanted` is not called, and the symbol that was written is returned.
    fn code(
        &mut self,
        distributions: &[Distribution],
        table: u16,
        wanted: impl FnOnce() -> i32,
    ) -> Result<i32, Damaged>;
}

/// Remembers symbols, and codes them when all are known: the coder is a stack, so the last symbol is coded first.
#[derive(Debug, Default)]
pub(crate) struct SymbolWriter {
    symbols: Vec<i32>,
    tables: Vec<u16>,
}

impl SymbolCoder for SymbolWriter {
    #[inline]
    fn code(&mut self, _: &[Distribution], table: u16, wanted: impl FnOnce() -> i32) -> Result<i32, Damaged> {
        let symbol = wanted();
        if symbol.unsigned_abs() > SYMBOL_LIMIT as u32 {
            return Err(Damaged);
        }
        self.symbols.push(symbol);
        self.tables.push(table);
        Ok(symbol)
    }
}

impl SymbolWriter {
    /// The bytes: the coder's words, little-endian, without the zeros at the end of the last one.
    pub(crate) fn finish(&self, distributions: &[Distribution]) -> Vec<u8> {
        let mut coder = DefaultAnsCoder::new();
        for (&symbol, &table) in self.symbols.iter().zip(&self.tables).rev() {
            let distribution = &distributions[usize::from(table)];
            let slot = distribution.slot(symbol);
            if slot == distribution.escape() {
                push_escaped(&mut coder, distribution, symbol);
            }
            coder.encode_symbol(slot, distribution).expect("every slot has a frequency");
        }
        let words = coder.into_compressed().unwrap_infallible();
        let mut bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        while bytes.last() == Some(&0) {
            bytes.pop();
        }
        bytes
    }
}

/// Pushes the bits after an escape, in reverse: the side, then the distance from the table as an Exp-Golomb code of
/// order 0.
fn push_escaped(coder: &mut DefaultAnsCoder, distribution: &Distribution, symbol: i32) {
    let (above, distance) = match symbol.checked_sub(distribution.first) {
        Some(offset) if offset >= 0 => (true, offset as u32 - distribution.escape() as u32),
        _ => (false, distribution.first.abs_diff(symbol) - 1),
    };
    let (number, zeros) = (distance + 1, (distance + 1).ilog2());
    let mut push = |bit: u32| coder.encode_symbol(bit, Coin).expect("both sides are possible");
    (0..zeros).for_each(|digit| push(number >> digit & 1));
    push(1);
    (0..zeros).for_each(|_| push(0));
    push(above.into());
}

/// Reads what a [`SymbolWriter`] has written.
#[derive(Debug)]
pub(crate) struct SymbolReader {
    coder: DefaultAnsCoder,
}

impl SymbolReader {
    /// A reader of the bytes of one sub-stream.
    pub(crate) fn new(bytes: &[u8]) -> Result<Self, Damaged> {
        if bytes.last() == Some(&0) {
            return Err(Damaged);
        }
        let word = |chunk: &[u8]| {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            u32::from_le_bytes(word)
        };
        let words: Vec<u32> = bytes.chunks(4).map(word).collect();
        Ok(Self { coder: DefaultAnsCoder::from_compressed(words).map_err(|_| Damaged)? })
    }

    /// Refuses bytes that hold more symbols than were read.
    pub(crate) fn finish(self) -> Result<(), Damaged> {
        if self.coder.is_empty() { Ok(()) } else { Err(Damaged) }
    }

    fn escaped(&mut self, distribution: &Distribution) -> Result<i32, Damaged> {
        let mut flip = || self.coder.decode_symbol(Coin).expect("a coin has both sides");
        let above = flip() == 1;
        let mut zeros = 0;
        while flip() == 0 {
            zeros += 1;
            if zeros > MOST_ZEROS {
                return Err(Damaged);
            }
        }
        let number = (0..zeros).fold(1, |number, _| number << 1 | i64::from(flip()));
        let first = i64::from(distribution.first);
        let symbol = if above { first + distribution.escape() as i64 + number - 1 } else { first - number };
        match i32::try_from(symbol) {
            Ok(symbol) if symbol.unsigned_abs() <= SYMBOL_LIMIT as u32 => Ok(symbol),
            _ => Err(Damaged),
        }
    }
}

impl SymbolCoder for SymbolReader {
    #[inline]
    fn code(&mut self, distributions: &[Distribution], table: u16, _: impl FnOnce() -> i32) -> Result<i32, Damaged> {
        let distribution = &distributions[usize::from(table)];
        let slot = self.coder.decode_symbol(distribution).expect("every quantile has a slot");
        if slot == distribution.escape() { self.escaped(distribution) } else { Ok(distribution.first + slot as i32) }
    }
}

/// A bit that is 0 or 1 with equal probability.
#[derive(Clone, Copy, Debug)]
struct Coin;

const HALF: u32 = 1 << (TOTAL_BITS - 1);

impl EntropyModel<TOTAL_BITS> for Coin {
    type Symbol = u32;
    type Probability = u32;
}

impl EncoderModel<TOTAL_BITS> for Coin {
    fn left_cumulative_and_probability(&self, bit: impl Borrow<u32>) -> Option<(u32, NonZeroU32)> {
        Some((bit.borrow() * HALF, NonZeroU32::new(HALF)?))
    }
}

impl DecoderModel<TOTAL_BITS> for Coin {
    fn quantile_function(&self, quantile: u32) -> (u32, u32, NonZeroU32) {
        let bit = u32::from(quantile >= HALF);
        (bit, bit * HALF, NonZeroU32::new(HALF).expect("not zero"))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{FrequencyTable, entropy::gaussian_table};

    fn round_trip(distributions: &[Distribution], symbols: &[(u16, i32)]) -> usize {
        let mut writer = SymbolWriter::default();
        for &(table, symbol) in symbols {
            writer.code(distributions, table, || symbol).unwrap();
        }
        let bytes = writer.finish(distributions);
        let mut reader = SymbolReader::new(&bytes).unwrap();
        for &(table, symbol) in symbols {
            assert_eq!(reader.code(distributions, table, || unreachable!()).unwrap(), symbol);
        }
        reader.finish().unwrap();
        bytes.len()
    }

    proptest! {
        #[test]
        fn any_symbols_come_back(symbols in prop::collection::vec(
            (0u16..128, prop_oneof![-2..=2, -400..=400, -SYMBOL_LIMIT..=SYMBOL_LIMIT]), 0..200))
        {
            round_trip(&gaussian_table().levels, &symbols);
        }

        #[test]
        fn any_bytes_decode_to_something(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            let levels = &gaussian_table().levels;
            if let Ok(mut reader) = SymbolReader::new(&bytes) {
                for table in 0..400 {
                    let _ = reader.code(levels, table % 128, || 0);
                }
            }
        }
    }

    #[test]
    fn nothing_takes_no_bytes_and_certainty_next_to_none() {
        assert_eq!(round_trip(&gaussian_table().levels, &[]), 0);
        assert!(round_trip(&gaussian_table().levels, &[(0, 0); 10_000]) <= 4);
    }

    #[test]
    fn the_bytes_are_the_ideal_bits() {
        let tables = [FrequencyTable::from_pmf(-1, &[0.2, 0.5, 0.3]).unwrap().distribution()];
        let mut state = 1u32;
        let symbols: Vec<_> = (0..20_000)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (
                    0,
                    match state >> 16 {
                        0..13_107 => -1,
                        13_107..45_875 => 0,
                        _ => 1,
                    },
                )
            })
            .collect();
        let ideal: f64 = symbols.iter().map(|&(_, symbol)| tables[0].bits(symbol)).sum();
        let coded = 8.0 * round_trip(&tables, &symbols) as f64;
        assert!((coded / ideal - 1.0).abs() < 0.002, "{coded} bits, ideal {ideal}");
    }

    #[test]
    fn symbols_beyond_the_limit_are_refused() {
        let levels = &gaussian_table().levels;
        for symbol in [SYMBOL_LIMIT + 1, i32::MIN, i32::MAX] {
            assert!(SymbolWriter::default().code(levels, 0, || symbol).is_err());
        }
    }
}
