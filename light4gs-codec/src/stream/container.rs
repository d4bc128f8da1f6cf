//! The container: a header, the scene meta, a table of sections, the sections.
//!
//! `docs/format.md` has the layout. Sections follow each other without gaps in the order of the table, so that every
//! byte of a stream belongs to something that a checksum covers.

use super::meta;
use crate::{
    CodecError, Limits, SceneMeta,
    bytes::{
        Reader, Writer,
        sections::{Encoding, Kind, Section},
    },
    format::{MAGIC, VERSION},
    limits::at_most,
};

/// Bytes before the meta.
pub(crate) const PRELUDE: usize = 32;
/// Bytes of the prelude that its checksum covers; the checksum fills the rest.
const PRELUDE_COVERED: usize = 28;
/// Bytes of one entry of the table.
const ENTRY: usize = 16;

/// One section as the table has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) section: Section,
    pub(crate) kind: Kind,
    pub(crate) encoding: Encoding,
    pub(crate) crc: u32,
    /// Where it begins in the stream.
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
}

/// The fixed first bytes, checked as far as possible without the rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prelude {
    pub(crate) version: u16,
    pub(crate) flags: u16,
    section_count: u32,
    meta_bytes: u32,
    pub(crate) file_bytes: u64,
    crc: u32,
}

impl Prelude {
    /// Reads the first [`PRELUDE`] bytes of `bytes`.
    pub(crate) fn read(bytes: &[u8], limits: &Limits) -> Result<Self, CodecError> {
        let start = &bytes[..bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(start) {
            return Err(CodecError::NotL4gs { found: start.to_vec() });
        }
        let mut reader = Reader::new("header", bytes);
        reader.take("magic", MAGIC.len() as u64)?;
        let version = reader.u16("version")?;
        match version {
            0 => {
                return Err(CodecError::invalid("header", "version", 0, "1 or more; the stream is damaged"));
            }
            VERSION => {}
            _ => return Err(CodecError::NewerVersion { found: version }),
        }
        let prelude = Self {
            version,
            flags: reader.u16("flags")?,
            section_count: reader.u32("section count")?,
            meta_bytes: reader.u32("length of the meta")?,
            file_bytes: reader.u64("length of the stream")?,
            crc: reader.u32("checksum")?,
        };
        at_most("header", "length of the stream", prelude.file_bytes, limits.file_bytes)?;
        at_most("header", "section count", prelude.section_count.into(), limits.sections)?;
        at_most("header", "length of the meta", prelude.meta_bytes.into(), limits.meta_bytes)?;
        Ok(prelude)
    }
}

/// A stream whose header, meta and table have been checked. The sections' checksums are checked when they are read.
#[derive(Clone, Debug)]
pub(crate) struct Container<'a> {
    bytes: &'a [u8],
    pub(crate) prelude: Prelude,
    pub(crate) meta: SceneMeta,
    pub(crate) entries: Vec<Entry>,
}

impl<'a> Container<'a> {
    /// Reads everything before the sections.
    pub(crate) fn read(bytes: &'a [u8], limits: &Limits) -> Result<Self, CodecError> {
        let prelude = Prelude::read(bytes, limits)?;
        let (stated, there) = (prelude.file_bytes, bytes.len() as u64);
        if stated > there {
            return Err(CodecError::Truncated {
                section: "stream",
                field: "the whole".into(),
                needed: stated,
                available: there,
            });
        }
        if stated < there {
            return Err(CodecError::TrailingBytes { section: "stream", bytes: there - stated });
        }

        let mut reader = Reader::new("header", &bytes[PRELUDE..]);
        let meta_bytes = reader.take("meta", prelude.meta_bytes.into())?;
        let table = reader.take("table", u64::from(prelude.section_count) * ENTRY as u64)?;
        let header_bytes = PRELUDE + meta_bytes.len() + table.len();
        let computed = header_checksum(&bytes[..header_bytes]);
        if computed != prelude.crc {
            return Err(CodecError::Checksum { section: "header", stored: prelude.crc, computed });
        }
        if prelude.flags != 0 {
            let found = format!("{:#06x}", prelude.flags);
            return Err(CodecError::invalid("header", "flags", found, "0, there are none yet; use a newer program"));
        }

        let entries = read_table(table, header_bytes as u64, stated)?;
        let meta = meta::read(meta_bytes, limits)?;
        meta::check(&meta, limits)?;
        Ok(Self { bytes, prelude, meta, entries })
    }

    pub(crate) fn has(&self, section: Section) -> bool {
        self.entries.iter().any(|entry| entry.section == section)
    }

    /// The kind, encoding and bytes of a section; the bytes are checked against their checksum.
    pub(crate) fn section(&self, section: Section) -> Result<(Kind, Encoding, &'a [u8]), CodecError> {
        let name = section.name();
        let entry = self.entries.iter().find(|entry| entry.section == section);
        let entry = entry.ok_or(CodecError::MissingSection { section: name })?;
        // `read_table` has checked that the range is inside the stream, whose length is a `usize`.
        let payload = &self.bytes[entry.offset as usize..(entry.offset + entry.bytes) as usize];
        let computed = crc32c::crc32c(payload);
        if computed != entry.crc {
            return Err(CodecError::Checksum { section: name, stored: entry.crc, computed });
        }
        Ok((entry.kind, entry.encoding, payload))
    }
}

/// Reads the table and checks that the sections fill the stream from `start` to `end`, each of them once.
fn read_table(table: &[u8], start: u64, end: u64) -> Result<Vec<Entry>, CodecError> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut offset = start;
    for (index, row) in table.chunks_exact(ENTRY).enumerate() {
        let mut reader = Reader::new("table", row);
        let id = reader.u16("section id")?;
        let section = Section::from_id(id).ok_or(CodecError::UnknownSection { index: index as u32, id })?;
        let name = section.name();
        let kind = Kind::from_number(section, reader.u8("kind")?)?;
        let encoding = Encoding::from_number(kind, reader.u8("encoding")?)?;
        let crc = reader.u32("checksum")?;
        let bytes = reader.u64("length")?;
        if entries.iter().any(|entry| entry.section == section) {
            return Err(CodecError::DuplicateSection { section: name });
        }
        if bytes > end - offset {
            let (needed, available) = (bytes, end - offset);
            return Err(CodecError::Truncated { section: name, field: "the section".into(), needed, available });
        }
        entries.push(Entry { section, kind, encoding, crc, offset, bytes });
        offset += bytes;
    }
    match end - offset {
        0 => Ok(entries),
        bytes => Err(CodecError::TrailingBytes { section: "stream", bytes }),
    }
}

/// The checksum of a header: over all of it except the checksum itself.
fn header_checksum(header: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&header[..PRELUDE_COVERED]), &header[PRELUDE..])
}

/// A section to be written.
#[derive(Debug)]
pub(crate) struct NewSection {
    pub(crate) kind: Kind,
    pub(crate) encoding: Encoding,
    pub(crate) payload: Vec<u8>,
}

/// A stream of these sections, in their order.
pub(crate) fn write(meta: &SceneMeta, sections: &[NewSection], limits: &Limits) -> Result<Vec<u8>, CodecError> {
    let mut writer = Writer::default();
    writer.bytes.resize(PRELUDE, 0);
    meta::write(meta, &mut writer);
    let meta_bytes = writer.bytes.len() - PRELUDE;
    at_most("meta", "length", meta_bytes as u64, limits.meta_bytes)?;
    for NewSection { kind, encoding, payload } in sections {
        let (section, number) = kind.place();
        writer.u16(section.id());
        writer.u8(number);
        writer.u8(encoding.number());
        writer.u32(crc32c::crc32c(payload));
        writer.u64(payload.len() as u64);
    }
    let header_bytes = writer.bytes.len();
    sections.iter().for_each(|section| writer.bytes.extend_from_slice(&section.payload));
    let mut bytes = writer.bytes;

    let mut prelude = Writer::default();
    prelude.bytes.extend_from_slice(&MAGIC);
    prelude.u16(VERSION);
    prelude.u16(0); // flags
    prelude.u32(sections.len() as u32);
    prelude.u32(meta_bytes as u32);
    prelude.u64(bytes.len() as u64);
    bytes[..PRELUDE_COVERED].copy_from_slice(&prelude.bytes);
    let crc = header_checksum(&bytes[..header_bytes]);
    bytes[PRELUDE_COVERED..PRELUDE].copy_from_slice(&crc.to_le_bytes());
    Ok(bytes)
}
