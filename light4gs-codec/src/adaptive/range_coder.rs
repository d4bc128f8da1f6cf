//! Bits into bytes and back: `constriction`'s range coder under binary models.

use std::{borrow::Borrow, num::NonZeroU16};

use constriction::{
    Queue, UnwrapInfallible,
    backends::ReadWords,
    stream::{
        Decode, Encode,
        model::{DecoderModel, EncoderModel, EntropyModel},
        queue::{RangeDecoder, RangeEncoder},
    },
};

/// Bits of a probability.
const PRECISION: usize = 15;
const ONE: u16 = 1 << PRECISION;
/// The smallest probability, and the distance of the largest from 1: a decision takes 2^-10 to 11 bits.
const LEAST: u32 = 1 << 4;
/// Most bits that [`BitCoder::raw`] codes at a time.
const RAW_CHUNK: u32 = 12;

/// The unit of reading and writing. It is small, because the end of a stream takes one or two of them.
type Word = u16;
/// The state of the range coder. It is large so that no interval is rounded noticeably.
type State = u64;
/// Words that the decoder reads ahead: the most that it reads beyond the end of a sound stream.
const READ_AHEAD: u32 = State::BITS / Word::BITS;

/// The probability that a bit is one, in units of 2^-15, never 0 and never 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probability(u16);

impl Probability {
    /// From units of 2^-15.
    #[inline]
    pub(crate) fn new(one: u32) -> Self {
        Self(one.clamp(LEAST, u32::from(ONE) - LEAST) as u16)
    }
}

/// The bytes end too early, or are not what an encoder writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Damaged;

/// A coder of binary decisions, in either direction.
pub(crate) trait BitCoder {
    /// Codes one decision. When encoding, `bit` is written and returned. When decoding, `bit` is ignored, and the bit
    /// that was written is returned.
    fn bit(&mut self, one: Probability, bit: bool) -> bool;

    /// Codes the lowest `bits` (at most 32) of `value`, all equally likely. Symmetric as [`BitCoder::bit`].
    fn raw(&mut self, bits: u32, value: u32) -> u32;

    /// Whether decoding still makes sense. Loops over counts from the stream call this, so that they end with the
    /// bytes. What a damaged decoder returns is arbitrary but harmless.
    fn check(&self) -> Result<(), Damaged>;
}

/// Writes decisions.
#[derive(Debug, Default)]
pub(crate) struct BitEncoder {
    coder: RangeEncoder<Word, State>,
}

impl BitEncoder {
    /// The bytes. A decoder ignores bytes after them.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.coder.into_compressed().unwrap_infallible().into_iter().flat_map(Word::to_le_bytes).collect()
    }
}

impl BitCoder for BitEncoder {
    #[inline]
    fn bit(&mut self, one: Probability, bit: bool) -> bool {
        self.coder.encode_symbol(bit, one).expect("both decisions have a positive probability");
        bit
    }

    fn raw(&mut self, bits: u32, value: u32) -> u32 {
        for (shift, chunk) in raw_chunks(bits) {
            let symbol = value >> shift & ((1 << chunk.0) - 1);
            self.coder.encode_symbol(symbol as u16, chunk).expect("every chunk has a positive probability");
        }
        value
    }

    fn check(&self) -> Result<(), Damaged> {
        Ok(())
    }
}

/// Reads decisions.
#[derive(Debug)]
pub(crate) struct BitDecoder<'a> {
    coder: RangeDecoder<Word, State, PaddedWords<'a>>,
    damaged: bool,
}

impl<'a> BitDecoder<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let words = PaddedWords { rest: bytes, missing: 0 };
        Self { coder: RangeDecoder::with_backend(words).expect("the padding covers the first words"), damaged: false }
    }

    #[inline]
    fn symbol<M>(&mut self, model: M) -> M::Symbol
    where
        M: DecoderModel<PRECISION, Probability = u16, Symbol: Default>,
    {
        if !self.damaged {
            match self.coder.decode_symbol(model) {
                Ok(symbol) => return symbol,
                Err(_) => self.damaged = true,
            }
        }
        M::Symbol::default()
    }
}

impl BitCoder for BitDecoder<'_> {
    #[inline]
    fn bit(&mut self, one: Probability, _: bool) -> bool {
        self.symbol(one)
    }

    fn raw(&mut self, bits: u32, _: u32) -> u32 {
        let mut value = 0;
        for (shift, chunk) in raw_chunks(bits) {
            value |= u32::from(self.symbol(chunk)) << shift;
        }
        value
    }

    fn check(&self) -> Result<(), Damaged> {
        if self.damaged { Err(Damaged) } else { Ok(()) }
    }
}

/// Little-endian words of a slice, and then as many zeros as a decoder of a sound stream can ask for.
#[derive(Debug)]
struct PaddedWords<'a> {
    rest: &'a [u8],
    missing: u32,
}

impl ReadWords<Word, Queue> for PaddedWords<'_> {
    type ReadError = Damaged;

    #[inline]
    fn read(&mut self) -> Result<Option<Word>, Damaged> {
        let word = match *self.rest {
            [low, high, ref rest @ ..] => {
                self.rest = rest;
                Word::from_le_bytes([low, high])
            }
            [low] => {
                self.rest = &[];
                low.into()
            }
            [] if self.missing < READ_AHEAD => {
                self.missing += 1;
                0
            }
            [] => return Err(Damaged),
        };
        Ok(Some(word))
    }
}

impl EntropyModel<PRECISION> for Probability {
    type Symbol = bool;
    type Probability = u16;
}

impl EncoderModel<PRECISION> for Probability {
    #[inline]
    fn left_cumulative_and_probability(&self, bit: impl Borrow<bool>) -> Option<(u16, NonZeroU16)> {
        let zero = ONE - self.0;
        let (left, probability) = if *bit.borrow() { (zero, self.0) } else { (0, zero) };
        Some((left, NonZeroU16::new(probability)?))
    }
}

impl DecoderModel<PRECISION> for Probability {
    #[inline]
    fn quantile_function(&self, quantile: u16) -> (bool, u16, NonZeroU16) {
        let bit = quantile >= ONE - self.0;
        let (left, probability) = self.left_cumulative_and_probability(bit).expect("never 0, never 1");
        (bit, left, probability)
    }
}

/// A number of bits, all equally likely.
#[derive(Clone, Copy, Debug)]
struct RawBits(u32);

/// The chunks of `bits` raw bits: their positions in the value, lowest first, and their models.
fn raw_chunks(bits: u32) -> impl Iterator<Item = (u32, RawBits)> {
    (0..bits).step_by(RAW_CHUNK as usize).map(move |shift| (shift, RawBits((bits - shift).min(RAW_CHUNK))))
}

impl RawBits {
    /// The probability of each symbol, in units of 2^-15.
    #[inline]
    fn share(self) -> u16 {
        ONE >> self.0
    }
}

impl EntropyModel<PRECISION> for RawBits {
    type Symbol = u16;
    type Probability = u16;
}

impl EncoderModel<PRECISION> for RawBits {
    #[inline]
    fn left_cumulative_and_probability(&self, symbol: impl Borrow<u16>) -> Option<(u16, NonZeroU16)> {
        let share = self.share();
        Some((*symbol.borrow() * share, NonZeroU16::new(share)?))
    }
}

impl DecoderModel<PRECISION> for RawBits {
    #[inline]
    fn quantile_function(&self, quantile: u16) -> (u16, u16, NonZeroU16) {
        let symbol = quantile / self.share();
        let (left, probability) = self.left_cumulative_and_probability(symbol).expect("at most 12 bits at a time");
        (symbol, left, probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every chunk size, mixed with sure and unsure bits.
    fn code(coder: &mut impl BitCoder, values: &mut [(bool, u32)]) {
        for (index, (bit, value)) in values.iter_mut().enumerate() {
            *bit = coder.bit(Probability::new(1 << (index % 16)), *bit);
            *value = coder.raw(index as u32 % 33, *value);
        }
    }

    #[test]
    fn bits_come_back_in_order() {
        let mut written: Vec<_> = (0..2000_u32)
            .map(|i| {
                (
                    i.wrapping_mul(0x9e37_79b9) >> 31 == 1,
                    ((u64::from(i) * 0x1234_5678_9abc) as u32) & ((1_u64 << (i % 33)) - 1) as u32,
                )
            })
            .collect();
        let mut encoder = BitEncoder::default();
        code(&mut encoder, &mut written);
        let mut bytes = encoder.finish();
        let mut read = vec![(false, 0); written.len()];
        let mut decoder = BitDecoder::new(&bytes);
        code(&mut decoder, &mut read);
        assert_eq!(decoder.check(), Ok(()));
        assert_eq!(read, written);

        // Bytes after the end do not matter.
        bytes.extend([0xff; 9]);
        code(&mut BitDecoder::new(&bytes), &mut read);
        assert_eq!(read, written);
    }

    #[test]
    fn the_end_of_the_bytes_is_noticed() {
        for bytes in [&[][..], &[7], &[1, 2, 3, 4, 5]] {
            let mut decoder = BitDecoder::new(bytes);
            for _ in 0..20 {
                decoder.raw(32, 0);
            }
            assert_eq!(decoder.check(), Err(Damaged));
            assert!(!decoder.bit(Probability::new(1 << 14), true));
        }
    }

    #[test]
    fn nothing_takes_no_bytes() {
        assert_eq!(BitEncoder::default().finish(), []);
        assert_eq!(BitDecoder::new(&[]).check(), Ok(()));
    }
}
