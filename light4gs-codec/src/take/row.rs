//! A row of the index. A block of the index is a link to the next block, and then slots; both are rows.

use super::{SECTION, SegmentPlace, SegmentTimes};
use crate::{
    CodecError,
    bytes::{Reader, Writer},
};

/// Bytes of a row. It divides the length of a sector.
pub(super) const BYTES: u64 = 64;
/// Bytes of a row before its checksum.
const COVERED: usize = BYTES as usize - 4;

/// The bytes of a row.
pub(super) type Row = [u8; BYTES as usize];

/// Where the next block of the index is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link {
    pub(super) offset: u64,
    pub(super) capacity: u32,
}

/// Bytes of a block of the index with so many slots.
pub(super) fn block_bytes(capacity: u32) -> u64 {
    BYTES * (1 + u64::from(capacity))
}

impl Link {
    /// The bytes of the block that it leads to.
    pub(super) fn range(&self) -> std::ops::Range<u64> {
        self.offset..self.offset.saturating_add(block_bytes(self.capacity))
    }

    /// None where the row is unused.
    pub(super) fn read(row: &[u8]) -> Result<Option<Self>, CodecError> {
        let Some(mut reader) = used(row, "link of the index")? else { return Ok(None) };
        let link = Self { offset: reader.u64("offset of a block")?, capacity: reader.u32("slots of a block")? };
        let rest = reader.rest();
        if rest.iter().any(|&byte| byte != 0) {
            return Err(CodecError::invalid(SECTION, "rest of a link", format!("{rest:02x?}"), "zeros"));
        }
        Ok(Some(link))
    }

    pub(super) fn write(&self) -> Row {
        let mut writer = Writer::default();
        writer.u64(self.offset);
        writer.u32(self.capacity);
        finished(writer)
    }
}

impl SegmentPlace {
    /// None where the row is unused.
    pub(super) fn read(row: &[u8]) -> Result<Option<Self>, CodecError> {
        let Some(mut reader) = used(row, "slot of the index")? else { return Ok(None) };
        let [begin, end, stream_begin, stream_end] = [
            reader.f64("begin of a segment")?,
            reader.f64("end of a segment")?,
            reader.f64("stream_begin of a segment")?,
            reader.f64("stream_end of a segment")?,
        ];
        let (offset, bytes) = (reader.u64("offset of a segment")?, reader.u64("length of a segment")?);
        let times = SegmentTimes { begin, end, stream_begin, stream_end, frames: reader.u32("frames of a segment")? };
        let hidden_bytes = reader.u32("length of a hidden list")?;
        let checksum = reader.u32("checksum of a segment")?;
        Ok(Some(Self { times, offset, bytes, hidden_bytes, checksum }))
    }

    pub(super) fn write(&self) -> Row {
        let Self { times, offset, bytes, hidden_bytes, checksum } = *self;
        let mut writer = Writer::default();
        [times.begin, times.end, times.stream_begin, times.stream_end].iter().for_each(|&time| writer.f64(time));
        writer.u64(offset);
        writer.u64(bytes);
        writer.u32(times.frames);
        writer.u32(hidden_bytes);
        writer.u32(checksum);
        finished(writer)
    }
}

/// A reader of what a row says, after its checksum is checked; none where the row is unused, which is all zero.
fn used<'a>(row: &'a [u8], field: &'static str) -> Result<Option<Reader<'a>>, CodecError> {
    if row.iter().all(|&byte| byte == 0) {
        return Ok(None);
    }
    let mut reader = Reader::new(SECTION, row);
    let covered = reader.take(field, COVERED as u64)?;
    let (stored, computed) = (reader.u32(field)?, crc32c::crc32c(covered));
    if stored != computed {
        return Err(CodecError::Checksum { section: field, stored, computed });
    }
    Ok(Some(Reader::new(SECTION, covered)))
}

/// The row with zeros to its end and its checksum.
fn finished(writer: Writer) -> Row {
    let mut row: Row = [0; BYTES as usize];
    row[..writer.bytes.len()].copy_from_slice(&writer.bytes);
    let crc = crc32c::crc32c(&row[..COVERED]);
    row[COVERED..].copy_from_slice(&crc.to_le_bytes());
    row
}
