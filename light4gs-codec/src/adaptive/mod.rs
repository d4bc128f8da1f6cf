//! Adaptive entropy coding of bits and integers.
//!
//! The models learn while they code, from what both sides have seen, so a stream needs no tables. All arithmetic
//! is on integers: the bytes and the numbers are the same on every machine.
//!
//! Encoder and decoder share one description of what is coded, and so cannot drift apart: a function that is
//! generic over [`BitCoder`] takes every value and returns it. When it encodes, the value that comes back is the one
//! that went in; when it decodes, what goes in is ignored and what comes back was read.

mod bit;
mod integer;
mod range_coder;
mod uniform_quantizer;

pub(crate) use bit::AdaptiveBit;
pub(crate) use integer::{AdaptiveInteger, magnitude_level};
pub(crate) use range_coder::{BitCoder, BitDecoder, BitEncoder, Damaged};
pub(crate) use uniform_quantizer::{LARGEST_INDEX, LARGEST_STEP, index, reconstruct};
