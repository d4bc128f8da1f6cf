//! Adaptive entropy coding of bits and integers.
//!
//! The models learn while they code, from what encoder and decoder have both seen, so a stream needs no tables. All
//! arithmetic is on integers: the bytes and the numbers are the same on every machine.
//!
//! Encoder and decoder are one function, so that they cannot differ. It is generic over [`BitCoder`], takes every value
//! and returns it. When it encodes, it returns the value that it was given. When it decodes, it ignores the value that
//! it was given and returns the one that was read.

mod bit;
mod integer;
mod range_coder;
mod uniform_quantizer;

pub(crate) use bit::AdaptiveBit;
pub(crate) use integer::{AdaptiveInteger, magnitude_level};
pub(crate) use range_coder::{BitCoder, BitDecoder, BitEncoder, Damaged};
pub(crate) use uniform_quantizer::{LARGEST_INDEX, LARGEST_STEP, index, reconstruct};
