//! Reading the index, range by range, by whatever means the bytes come.

use std::ops::Range;

use super::{
    SECTION, SegmentPlace, TakeIndex, TakeMeta,
    index::{Room, check_overlaps},
    prelude::{PRELUDE, Prelude},
    row::{self, Link},
};
use crate::{CodecError, Limits, limits::at_most};

/// Reads the index of a take from ranges of the file: for a player that fetches them over a network.
///
/// [`IndexReader::needed`] says which range comes next, and [`IndexReader::push`] takes its bytes: first the prelude, then all
/// that is before the base, then further blocks of the index where the take has grown. Memory is taken for as many segments as
/// the [`Limits`] allow, and for no more than the bytes that were pushed.
///
/// ```
/// use light4gs_codec::{CodecError, Limits, take::{IndexReader, TakeIndex}};
///
/// fn read_index(file: &[u8]) -> Result<TakeIndex, CodecError> {
///     let mut reader = IndexReader::new(&Limits::default());
///     while let Some(range) = reader.needed() {
///         let end = file.len().min(range.end as usize);
///         reader.push(&file[end.min(range.start as usize)..end])?; // a range that is fetched
///     }
///     reader.finish(file.len() as u64)
/// }
/// # use light4gs_codec::{SceneData, encode, take::{TakeMeta, write_take}};
/// # let bytes = write_take(&TakeMeta::default(), &encode(&SceneData::default())?, &[], 4)?;
/// # assert!(read_index(&bytes)?.segments().is_empty());
/// # assert!(read_index(&bytes[..100]).is_err());
/// # Ok::<(), CodecError>(())
/// ```
#[derive(Debug)]
pub struct IndexReader {
    limits: Limits,
    needed: Option<Range<u64>>,
    prelude: Option<Prelude>,
    meta: Option<TakeMeta>,
    segments: Vec<SegmentPlace>,
    room: Room,
}

impl IndexReader {
    /// A reader that waits for the first bytes.
    pub fn new(limits: &Limits) -> Self {
        Self {
            limits: *limits,
            needed: Some(0..PRELUDE as u64),
            prelude: None,
            meta: None,
            segments: Vec::new(),
            room: Room::default(),
        }
    }

    /// The range of the file that must be pushed next; none where the index is complete. Ranges may lie in bytes that
    /// were pushed before.
    pub fn needed(&self) -> Option<Range<u64>> {
        self.needed.clone()
    }

    /// Takes the bytes of the range that [`IndexReader::needed`] names.
    ///
    /// # Errors
    /// Fewer or more bytes than the range has; no take, or one of a newer version; a wrong checksum; a number that breaks a rule
    /// of the format or a limit. After an error, a new reader is needed.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), CodecError> {
        let Some(range) = self.needed.clone() else {
            let found = format!("{} more bytes", bytes.len());
            return Err(CodecError::invalid(SECTION, "index", found, "nothing after its last range"));
        };
        let (needed, available) = (range.end - range.start, bytes.len() as u64);
        if self.prelude.is_none() && available < needed {
            // Another file has its name in the message, however short it is.
            Prelude::read(bytes, &self.limits)?;
        }
        if available < needed {
            return Err(CodecError::Truncated { section: SECTION, field: "index".into(), needed, available });
        }
        if available > needed {
            return Err(CodecError::TrailingBytes { section: SECTION, bytes: available - needed });
        }
        // What was refused stays needed, so that the index is not complete.
        self.needed = self.read(bytes, range.start)?;
        Ok(())
    }

    /// Reads the bytes of a range, and returns the next one.
    fn read(&mut self, bytes: &[u8], offset: u64) -> Result<Option<Range<u64>>, CodecError> {
        let Some(prelude) = self.prelude else {
            let prelude = Prelude::read(bytes, &self.limits)?;
            self.prelude = Some(prelude);
            return Ok(Some(0..prelude.front_bytes()));
        };
        if self.meta.is_some() {
            return self.read_block(bytes, offset, &prelude);
        }
        self.meta = Some(prelude.meta(bytes, &self.limits)?);
        let block = prelude.block_offset();
        self.read_block(&bytes[block as usize..], block, &prelude)
    }

    /// Reads a block of the index that begins at `offset` of the file.
    fn read_block(&mut self, bytes: &[u8], offset: u64, prelude: &Prelude) -> Result<Option<Range<u64>>, CodecError> {
        let mut rows = bytes.chunks_exact(row::BYTES as usize);
        let link = rows.next().map_or(Ok(None), Link::read)?;
        let slots = rows.len() as u64;
        self.room.capacity += slots;
        self.room.last_link = offset;
        for (index, bytes) in rows.enumerate() {
            match SegmentPlace::read(bytes)? {
                Some(place) => {
                    place.check(prelude.base_end(), prelude.base_gaussians, &self.limits)?;
                    self.segments.push(place);
                }
                None if self.room.free_slot.is_none() => {
                    self.room.free_slot = Some(offset + row::BYTES * (1 + index as u64));
                }
                None => {}
            }
        }
        let Some(link) = link else { return Ok(None) };
        // Blocks lie behind each other, so the chain has an end.
        let after = prelude.base_end().max(offset + row::block_bytes(slots as u32));
        if link.offset < after || !link.offset.is_multiple_of(row::BYTES) || link.range().end == u64::MAX {
            let expected = format!("a multiple of {} from {after} on, behind what is before it", row::BYTES);
            return Err(CodecError::invalid(SECTION, "offset of a block of the index", link.offset, expected));
        }
        if link.capacity == 0 {
            return Err(CodecError::invalid(SECTION, "slots of a further block", 0, "1 or more"));
        }
        let capacity = self.room.capacity + u64::from(link.capacity);
        at_most(SECTION, "slots of the index", capacity, self.limits.segments)?;
        Ok(Some(link.range()))
    }

    /// Whether all that is before the base has been read. Then [`IndexReader::finish_front`] can be called.
    pub fn has_front(&self) -> bool {
        self.meta.is_some()
    }

    /// The index without any segment, for a file of which so many bytes are there: what is said of the take, and where its base
    /// is. Further blocks of the index need not have been read, and what the segments of the first one say is not used: their bytes
    /// may be missing.
    ///
    /// # Errors
    /// A base that goes beyond the bytes; ranges before the base that were not pushed.
    pub fn finish_front(self, file_bytes: u64) -> Result<TakeIndex, CodecError> {
        let needed = self.needed.filter(|_| self.meta.is_none());
        let front = Self { needed, segments: Vec::new(), room: Room::default(), ..self };
        front.finish(file_bytes)
    }

    /// The index, for a file of a length in bytes. The length must have been asked for after the last range was read, where the
    /// file can grow.
    ///
    /// # Errors
    /// A base or a segment that goes beyond the end of the file, segments that overlap in time, ranges that were not pushed.
    pub fn finish(self, file_bytes: u64) -> Result<TakeIndex, CodecError> {
        let (Some(prelude), Some(meta), None) = (self.prelude, self.meta, &self.needed) else {
            return Err(CodecError::invalid(SECTION, "index", "not complete", "all ranges that it needs"));
        };
        let mut segments = self.segments;
        // Begins are no NaN: the times have been checked.
        segments.sort_by(|a, b| a.times.begin.total_cmp(&b.times.begin));
        check_overlaps(&segments)?;
        let base = prelude.base_offset..prelude.base_end();
        let ends = segments.iter().map(|place| ("a segment", place.range().end));
        for (field, needed) in ends.chain([("the base", base.end)]) {
            if needed > file_bytes {
                let field = format!("the file with {field}");
                return Err(CodecError::Truncated { section: SECTION, field, needed, available: file_bytes });
            }
        }
        Ok(TakeIndex { meta, base, base_gaussians: prelude.base_gaussians, segments, room: self.room })
    }
}
