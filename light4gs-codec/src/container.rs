//! The container: a header, the scene meta, a table of sections, the sections.
//!
//! `docs/format.md` has the layout. Sections follow each other without gaps in the order of the table, so that every
//! byte of a stream belongs to something that a checksum covers.

use crate::{
    CodecError, Limits, SceneMeta,
    limits::at_most,
    reader::Reader,
    sections::{SectionKind, meta},
    writer::Writer,
};

/// The first bytes of every stream. The first is not ASCII and two line ends follow, so that a transfer as text shows.
pub const MAGIC: [u8; 8] = *b"\x89L4GS\r\n\x1a";

/// The newest version, which [`crate::encode_compressed`] writes. [`crate::encode`] writes version 1, which needs no
/// more; [`crate::decode`] reads both.
pub const VERSION: u16 = 2;
/// The version of streams without compression.
pub(crate) const PLAIN_VERSION: u16 = 1;

/// Bytes before the meta.
pub(crate) const PRELUDE: usize = 32;
/// Bytes of the prelude that its checksum covers; the checksum fills the rest.
const PRELUDE_COVERED: usize = 28;
/// Bytes of one entry of the table.
const ENTRY: usize = 24;

/// How the numbers of a section are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// Plain little-endian float32.
    Float32,
    /// Quantised, then adaptively entropy coded.
    Quantised,
    /// Spherical harmonics under one frequency table a channel.
    FrequencyTables,
    /// Spherical harmonics, each degree from those below.
    Autoregressive,
    /// Spherical harmonics from the hexplane.
    HexplaneCoupled,
    /// Hexplanes under a context model.
    ContextCoded,
}

impl Encoding {
    const ALL: [Self; 6] = [
        Self::Float32,
        Self::Quantised,
        Self::FrequencyTables,
        Self::Autoregressive,
        Self::HexplaneCoupled,
        Self::ContextCoded,
    ];

    /// The number that stands in the table.
    pub const fn number(self) -> u16 {
        match self {
            Self::Float32 => 0,
            Self::Quantised => 1,
            Self::FrequencyTables => 2,
            Self::Autoregressive => 3,
            Self::HexplaneCoupled => 4,
            Self::ContextCoded => 5,
        }
    }

    /// The encoding with a number of the table, where a section of a stream of that version may have it.
    pub(crate) fn from_number(number: u16, kind: SectionKind, version: u16) -> Option<Self> {
        let encoding = Self::ALL.into_iter().find(|encoding| encoding.number() == number)?;
        let legal = match kind {
            _ if version == PLAIN_VERSION => matches!(encoding, Self::Float32),
            SectionKind::Gaussians | SectionKind::Deformation | SectionKind::ContextModel => {
                matches!(encoding, Self::Float32 | Self::Quantised)
            }
            SectionKind::Sh => !matches!(encoding, Self::Quantised | Self::ContextCoded),
            SectionKind::SceneFrame => matches!(encoding, Self::Float32),
            SectionKind::HexPlanes => matches!(encoding, Self::Float32 | Self::ContextCoded),
        };
        legal.then_some(encoding)
    }

    /// A name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Float32 => "float32",
            Self::Quantised => "quantised",
            Self::FrequencyTables => "frequency tables",
            Self::Autoregressive => "autoregressive",
            Self::HexplaneCoupled => "hexplane-coupled",
            Self::ContextCoded => "context model",
        }
    }
}

/// One section as the table has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) kind: SectionKind,
    pub(crate) encoding: Encoding,
    pub(crate) crc: u32,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
}

/// The fixed first bytes, checked as far as they can be alone.
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
            1..=VERSION => {}
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

/// A stream whose header, meta and table are sound. The sections' checksums are checked as they are read.
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

        let entries = read_table(table, prelude.version, header_bytes as u64, stated)?;
        let meta = meta::read(meta_bytes, limits)?;
        Ok(Self { bytes, prelude, meta, entries })
    }

    pub(crate) fn has(&self, kind: SectionKind) -> bool {
        self.entries.iter().any(|entry| entry.kind == kind)
    }

    /// The bytes of one section, checked against their checksum, and how they are coded.
    pub(crate) fn section(&self, kind: SectionKind) -> Result<(Encoding, &'a [u8]), CodecError> {
        let section = kind.name();
        let entry =
            self.entries.iter().find(|entry| entry.kind == kind).ok_or(CodecError::MissingSection { section })?;
        // `read_table` has found the range inside the stream, whose length is a `usize`.
        let payload = &self.bytes[entry.offset as usize..(entry.offset + entry.bytes) as usize];
        let computed = crc32c::crc32c(payload);
        if computed != entry.crc {
            return Err(CodecError::Checksum { section, stored: entry.crc, computed });
        }
        Ok((entry.encoding, payload))
    }
}

/// Reads the table and checks that the sections fill the stream from `start` to `end`, each of them once.
fn read_table(table: &[u8], version: u16, start: u64, end: u64) -> Result<Vec<Entry>, CodecError> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut expected = start;
    for (index, row) in table.chunks_exact(ENTRY).enumerate() {
        let mut reader = Reader::new("table", row);
        let id = reader.u16("section id")?;
        let kind = SectionKind::from_id(id)
            .filter(|kind| version > PLAIN_VERSION || SectionKind::CORE.contains(kind))
            .ok_or(CodecError::UnknownSection { index: index as u32, id })?;
        let section = kind.name();
        let number = reader.u16("encoding")?;
        let encoding = Encoding::from_number(number, kind, version)
            .ok_or(CodecError::UnknownEncoding { section, encoding: number })?;
        let crc = reader.u32("checksum")?;
        let offset = reader.u64("offset")?;
        let bytes = reader.u64("length")?;

        if entries.iter().any(|entry| entry.kind == kind) {
            return Err(CodecError::DuplicateSection { section });
        }
        let problem = |problem| Err(CodecError::SectionRange { section, offset, bytes, problem });
        if offset < start {
            return problem("overlap the header");
        }
        let Some(section_end) = offset.checked_add(bytes).filter(|&section_end| section_end <= end) else {
            return problem("reach beyond the end of the stream");
        };
        if offset < expected {
            return problem("overlap the section before");
        }
        if offset > expected {
            return problem("leave a gap before them");
        }
        expected = section_end;
        entries.push(Entry { kind, encoding, crc, offset, bytes });
    }
    for kind in SectionKind::CORE {
        if !entries.iter().any(|entry| entry.kind == kind) {
            return Err(CodecError::MissingSection { section: kind.name() });
        }
    }
    match end - expected {
        0 => Ok(entries),
        bytes => Err(CodecError::TrailingBytes { section: "stream", bytes }),
    }
}

/// The checksum of a header: all of it but the checksum itself.
fn header_checksum(header: &[u8]) -> u32 {
    crc32c::crc32c_append(crc32c::crc32c(&header[..PRELUDE_COVERED]), &header[PRELUDE..])
}

/// Puts a stream together, one section after the other.
pub(crate) struct Builder {
    version: u16,
    sections: usize,
    writer: Writer,
    table_at: usize,
    entries: Vec<Entry>,
}

impl Builder {
    /// A stream that holds `meta` and will hold some number of sections.
    pub(crate) fn new(version: u16, sections: usize, meta: &SceneMeta, limits: &Limits) -> Result<Self, CodecError> {
        let mut writer = Writer::default();
        writer.bytes.resize(PRELUDE, 0);
        meta::write(meta, &mut writer);
        let table_at = writer.bytes.len();
        at_most("meta", "length", (table_at - PRELUDE) as u64, limits.meta_bytes)?;
        writer.bytes.resize(table_at + ENTRY * sections, 0);
        Ok(Self { version, sections, writer, table_at, entries: Vec::new() })
    }

    /// Appends a section that `write` writes.
    pub(crate) fn section(&mut self, kind: SectionKind, encoding: Encoding, write: impl FnOnce(&mut Writer)) {
        let start = self.writer.bytes.len();
        write(&mut self.writer);
        let payload = &self.writer.bytes[start..];
        self.entries.push(Entry {
            kind,
            encoding,
            crc: crc32c::crc32c(payload),
            offset: start as u64,
            bytes: payload.len() as u64,
        });
    }

    /// Fills in the prelude and the table.
    pub(crate) fn finish(self) -> Vec<u8> {
        let Self { version, sections, writer: Writer { mut bytes }, table_at, entries } = self;
        debug_assert_eq!(entries.len(), sections);

        let mut table = Writer::default();
        for entry in &entries {
            table.u16(entry.kind.id());
            table.u16(entry.encoding.number());
            table.u32(entry.crc);
            table.u64(entry.offset);
            table.u64(entry.bytes);
        }
        let header_bytes = table_at + table.bytes.len();
        bytes[table_at..header_bytes].copy_from_slice(&table.bytes);

        let mut prelude = Writer::default();
        prelude.bytes.extend_from_slice(&MAGIC);
        prelude.u16(version);
        prelude.u16(0); // flags
        prelude.u32(entries.len() as u32);
        prelude.u32((table_at - PRELUDE) as u32);
        prelude.u64(bytes.len() as u64);
        bytes[..PRELUDE_COVERED].copy_from_slice(&prelude.bytes);
        let crc = header_checksum(&bytes[..header_bytes]);
        bytes[PRELUDE_COVERED..PRELUDE].copy_from_slice(&crc.to_le_bytes());
        bytes
    }
}
