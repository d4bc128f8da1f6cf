//! Little-endian values from a slice of bytes that may be damaged or hostile.

use std::array::from_fn;

use crate::{CodecError, limits::at_most};

/// Reads little-endian values from a slice. Memory is taken only for bytes that are there.
#[derive(Clone, Debug)]
pub(crate) struct Reader<'a> {
    section: &'static str,
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A reader of `bytes`; its errors name `section`.
    pub(crate) fn new(section: &'static str, bytes: &'a [u8]) -> Self {
        Self { section, rest: bytes }
    }

    /// The next `count` bytes.
    pub(crate) fn take(&mut self, field: &str, count: u64) -> Result<&'a [u8], CodecError> {
        self.demand(field, count)?;
        // `demand` has compared `count` with the length of a slice, so it fits.
        let (taken, rest) = self.rest.split_at(count as usize);
        self.rest = rest;
        Ok(taken)
    }

    /// Refuses unless `count` bytes are left.
    pub(crate) fn demand(&self, field: &str, count: u64) -> Result<(), CodecError> {
        let available = self.rest.len() as u64;
        if count <= available {
            return Ok(());
        }
        Err(CodecError::Truncated { section: self.section, field: field.to_owned(), needed: count, available })
    }

    pub(crate) fn array<const N: usize>(&mut self, field: &str) -> Result<[u8; N], CodecError> {
        let taken = self.take(field, N as u64)?;
        Ok(from_fn(|i| taken[i]))
    }

    pub(crate) fn u8(&mut self, field: &str) -> Result<u8, CodecError> {
        self.array(field).map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self, field: &str) -> Result<u16, CodecError> {
        self.array(field).map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self, field: &str) -> Result<u32, CodecError> {
        self.array(field).map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self, field: &str) -> Result<u64, CodecError> {
        self.array(field).map(u64::from_le_bytes)
    }

    /// An unsigned integer in groups of seven bits, lowest first, the upper bit set in all but the last. Each integer
    /// has only one encoding: the last group is not 0 unless it is the first.
    pub(crate) fn varint(&mut self, field: &str) -> Result<u64, CodecError> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.u8(field)?;
            let group = u64::from(byte & 0x7f);
            if group << shift >> shift != group || byte == 0 && shift > 0 {
                break;
            }
            value |= group << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(CodecError::invalid(self.section, field, "a wrong varint", "an integer below 2^64 without leading zeros"))
    }

    /// As [`Reader::varint`], at most `limit`.
    pub(crate) fn varint_at_most(&mut self, field: &str, limit: u32) -> Result<u32, CodecError> {
        let value = self.varint(field)?;
        at_most(self.section, field, value, limit)?;
        Ok(value as u32)
    }

    /// A length, and then that many bytes.
    pub(crate) fn block(&mut self, field: &str) -> Result<&'a [u8], CodecError> {
        let length = self.varint(field)?;
        self.take(field, length)
    }

    /// Everything that is left.
    pub(crate) fn rest(self) -> &'a [u8] {
        self.rest
    }

    pub(crate) fn f32(&mut self, field: &str) -> Result<f32, CodecError> {
        self.array(field).map(f32::from_le_bytes)
    }

    pub(crate) fn f64(&mut self, field: &str) -> Result<f64, CodecError> {
        self.array(field).map(f64::from_le_bytes)
    }

    /// `count` numbers.
    pub(crate) fn f32s(&mut self, field: &str, count: u64) -> Result<Vec<f32>, CodecError> {
        let taken = self.take(field, count.saturating_mul(4))?;
        Ok(taken.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
    }

    /// A finite number.
    pub(crate) fn finite(&mut self, field: &str) -> Result<f32, CodecError> {
        let value = self.f32(field)?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(CodecError::invalid(self.section, field, value, "a finite number"))
        }
    }

    /// One group of `K` numbers.
    pub(crate) fn group<const K: usize>(&mut self, field: &str) -> Result<[f32; K], CodecError> {
        let taken = self.take(field, 4 * K as u64)?;
        Ok(group(taken))
    }

    /// A string: its length in bytes as `u32`, then UTF-8.
    pub(crate) fn string(&mut self, field: &str, limit: u32) -> Result<String, CodecError> {
        let length = self.u32(field)?;
        at_most(self.section, format!("length of {field}"), length.into(), limit)?;
        let taken = self.take(field, length.into())?;
        match std::str::from_utf8(taken) {
            Ok(text) => Ok(text.to_owned()),
            Err(error) => Err(CodecError::invalid(self.section, field, error, "UTF-8")),
        }
    }

    /// Refuses bytes that have not been read.
    pub(crate) fn finish(self) -> Result<(), CodecError> {
        match self.rest.len() as u64 {
            0 => Ok(()),
            bytes => Err(CodecError::TrailingBytes { section: self.section, bytes }),
        }
    }
}

/// `K` numbers from `4 * K` bytes.
fn group<const K: usize>(bytes: &[u8]) -> [f32; K] {
    let words = bytes.as_chunks::<4>().0;
    from_fn(|i| f32::from_le_bytes(words[i]))
}
