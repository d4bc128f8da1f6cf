//! The beginning of a take: prelude, meta, and zeros up to the first block of the index.

use super::{SECTION, TakeMeta, row};
use crate::{
    CodecError, Limits,
    bytes::{Reader, Writer},
    format::{TAKE_MAGIC, VERSION},
    limits::at_most,
};

/// Bytes before the meta.
pub(super) const PRELUDE: usize = 44;
/// Bytes of the prelude before its checksum.
const COVERED: usize = PRELUDE - 4;

/// The fixed first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Prelude {
    meta_bytes: u32,
    /// Slots of the first block of the index.
    pub(super) capacity: u32,
    pub(super) base_offset: u64,
    pub(super) base_bytes: u64,
    pub(super) base_gaussians: u32,
    crc: u32,
}

impl Prelude {
    /// Reads the first [`PRELUDE`] bytes, and refuses what cannot be right whatever comes after them.
    pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Self, CodecError> {
        let start = &bytes[..bytes.len().min(TAKE_MAGIC.len())];
        if !TAKE_MAGIC.starts_with(start) {
            return Err(CodecError::NotTake { found: start.to_vec() });
        }
        let mut reader = Reader::new(SECTION, bytes);
        reader.take("magic", TAKE_MAGIC.len() as u64)?;
        match reader.u16("version")? {
            0 => return Err(CodecError::invalid(SECTION, "version", 0, "1 or more; the file is damaged")),
            VERSION => {}
            found => return Err(CodecError::NewerVersion { found }),
        }
        let flags = reader.u16("flags")?;
        if flags != 0 {
            let found = format!("{flags:#06x}");
            return Err(CodecError::invalid(SECTION, "flags", found, "0, there are none yet; use a newer program"));
        }
        let prelude = Self {
            meta_bytes: reader.u32("length of the meta")?,
            capacity: reader.u32("slots of the first block")?,
            base_offset: reader.u64("offset of the base")?,
            base_bytes: reader.u64("length of the base")?,
            base_gaussians: reader.u32("Gaussians of the base")?,
            crc: reader.u32("checksum")?,
        };
        at_most(SECTION, "length of the meta", prelude.meta_bytes.into(), limits.meta_bytes)?;
        at_most(SECTION, "slots of the index", prelude.capacity.into(), limits.segments)?;
        at_most(SECTION, "length of the base", prelude.base_bytes, limits.file_bytes)?;
        // A hidden list has a byte for each of them in memory.
        let gaussians = limits.memory_bytes.min(limits.gaussians.into());
        at_most(SECTION, "Gaussians of the base", prelude.base_gaussians.into(), gaussians)?;
        if prelude.base_offset != prelude.front_bytes() {
            let expected = format!("{}, where the first block of the index ends", prelude.front_bytes());
            return Err(CodecError::invalid(SECTION, "offset of the base", prelude.base_offset, expected));
        }
        Ok(prelude)
    }

    /// Where the first block of the index begins: at a multiple of the length of a row, so that a row lies within one sector of
    /// a disk, and is written whole or not at all.
    pub(super) fn block_offset(&self) -> u64 {
        (PRELUDE as u64 + u64::from(self.meta_bytes)).next_multiple_of(row::BYTES)
    }

    /// Bytes before the base.
    pub(super) fn front_bytes(&self) -> u64 {
        self.block_offset() + row::block_bytes(self.capacity)
    }

    /// Where the base ends. It does not overflow: [`Prelude::read`] has compared its terms with limits.
    pub(super) fn base_end(&self) -> u64 {
        self.base_offset.saturating_add(self.base_bytes)
    }

    /// The meta, from the bytes before the base or more of the file, whose checksum is checked.
    pub(super) fn meta(&self, bytes: &[u8], limits: &Limits) -> Result<TakeMeta, CodecError> {
        let mut reader = Reader::new(SECTION, bytes);
        let covered = reader.take("prelude", COVERED as u64)?;
        reader.take("checksum", (PRELUDE - COVERED) as u64)?;
        let meta_and_zeros = reader.take("meta", self.block_offset() - PRELUDE as u64)?;
        let computed = crc32c::crc32c_append(crc32c::crc32c(covered), meta_and_zeros);
        if computed != self.crc {
            return Err(CodecError::Checksum { section: SECTION, stored: self.crc, computed });
        }
        let (meta, zeros) = meta_and_zeros.split_at(self.meta_bytes as usize);
        if zeros.iter().any(|&byte| byte != 0) {
            return Err(CodecError::invalid(SECTION, "bytes after the meta", format!("{zeros:02x?}"), "zeros"));
        }
        TakeMeta::read(meta, limits)
    }
}

/// The bytes before the first block, and where the base begins.
pub(super) fn write(meta: &[u8], capacity: u32, base_bytes: u64, base_gaussians: u32) -> (Vec<u8>, u64) {
    let mut prelude =
        Prelude { meta_bytes: meta.len() as u32, capacity, base_offset: 0, base_bytes, base_gaussians, crc: 0 };
    prelude.base_offset = prelude.front_bytes();
    let mut writer = Writer { bytes: TAKE_MAGIC.to_vec() };
    writer.u16(VERSION);
    writer.u16(0);
    writer.u32(prelude.meta_bytes);
    writer.u32(capacity);
    writer.u64(prelude.base_offset);
    writer.u64(base_bytes);
    writer.u32(base_gaussians);
    let mut rest = meta.to_vec();
    rest.resize(prelude.block_offset() as usize - PRELUDE, 0);
    writer.u32(crc32c::crc32c_append(crc32c::crc32c(&writer.bytes), &rest));
    writer.bytes.extend(rest);
    (writer.bytes, prelude.base_offset)
}
