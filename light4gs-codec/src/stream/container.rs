//! The container: a header, the scene meta, a table of sections, the sections.
//!
//! `docs/format.md` has the layout. Sections follow each other without gaps in the order of the table, so that every
//! byte of a stream belongs to something that a checksum covers.

use std::borrow::Cow;

use super::meta;
use crate::{
    CodecError, Limits, SceneMeta,
    bytes::{
        Reader, Writer,
        sections::{Encoding, Kind, Section},
    },
    format::{MAGIC, TAKE_MAGIC, VERSION},
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
        if start == TAKE_MAGIC {
            return Err(CodecError::IsTake);
        }
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

impl Prelude {
    /// The bytes that its checksum covers.
    fn covered(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        writer.bytes.extend_from_slice(&MAGIC);
        writer.u16(self.version);
        writer.u16(self.flags);
        writer.u32(self.section_count);
        writer.u32(self.meta_bytes);
        writer.u64(self.file_bytes);
        writer.bytes
    }

    /// Refuses a stream of another length than the prelude says.
    pub(crate) fn check_length(&self, there: u64) -> Result<(), CodecError> {
        let stated = self.file_bytes;
        if stated > there {
            let field = "the whole".into();
            return Err(CodecError::Truncated { section: "stream", field, needed: stated, available: there });
        }
        if stated < there {
            return Err(CodecError::TrailingBytes { section: "stream", bytes: there - stated });
        }
        Ok(())
    }

    /// Bytes before the first section.
    pub(crate) fn header_bytes(&self) -> u64 {
        PRELUDE as u64 + u64::from(self.meta_bytes) + u64::from(self.section_count) * ENTRY as u64
    }
}

/// Everything before the sections, checked.
#[derive(Clone, Debug)]
pub(crate) struct Header {
    pub(crate) prelude: Prelude,
    pub(crate) meta: SceneMeta,
    pub(crate) entries: Vec<Entry>,
}

impl Header {
    /// Reads it from a stream, or from the beginning of one.
    pub(crate) fn read(bytes: &[u8], prelude: Prelude, limits: &Limits) -> Result<Self, CodecError> {
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

        let entries = read_table(table, header_bytes as u64, prelude.file_bytes)?;
        let meta = meta::read(meta_bytes, limits)?;
        meta::check(&meta, limits)?;
        Ok(Self { prelude, meta, entries })
    }

    pub(crate) fn has(&self, section: Section) -> bool {
        self.entries.iter().any(|entry| entry.section == section)
    }

    /// Layers of Gaussians.
    pub(crate) fn layers(&self) -> usize {
        self.entries.iter().filter(|entry| entry.section == Section::Gaussians).count()
    }

    /// The entry of a layer of a section.
    pub(crate) fn entry(&self, section: Section, layer: usize) -> Result<&Entry, CodecError> {
        let mut entries = self.entries.iter().filter(|entry| entry.section == section);
        entries.nth(layer).ok_or(CodecError::MissingSection { section: section.name() })
    }

    /// Bytes from the beginning of the stream to the end of what all layers share.
    pub(crate) fn shared_bytes(&self) -> u64 {
        let shared = self.entries.iter().filter(|entry| !entry.section.is_layered());
        shared.map(Entry::end).fold(self.prelude.header_bytes(), u64::max)
    }

    /// Bytes from the beginning of the stream to the end of a layer and of what all layers share.
    pub(crate) fn layer_bytes(&self, layer: usize) -> u64 {
        let of_layer = |section| self.entry(section, layer).map_or(0, Entry::end);
        self.shared_bytes().max(of_layer(Section::Gaussians)).max(of_layer(Section::Sh))
    }
}

impl Entry {
    /// Where the section ends in the stream.
    pub(crate) fn end(&self) -> u64 {
        self.offset + self.bytes
    }

    /// Writes its row of the table.
    fn write(&self, writer: &mut Writer) {
        let (section, number) = self.kind.place();
        writer.u16(section.id());
        writer.u8(number);
        writer.u8(self.encoding.number());
        writer.u32(self.crc);
        writer.u64(self.bytes);
    }
}

/// A stream, or its beginning, whose header, meta and table have been checked. The sections' checksums are checked when they
/// are read.
#[derive(Clone, Debug)]
pub(crate) struct Container<'a> {
    bytes: &'a [u8],
    pub(crate) header: Cow<'a, Header>,
    /// Whether the sections' checksums have been checked already.
    verified: bool,
}

impl<'a> Container<'a> {
    /// The beginning of a stream. The sections that are there have been checked against their checksums.
    pub(crate) fn beginning(bytes: &'a [u8], header: &'a Header) -> Self {
        Self { bytes, header: Cow::Borrowed(header), verified: true }
    }

    /// Reads everything before the sections.
    pub(crate) fn read(bytes: &'a [u8], limits: &Limits) -> Result<Self, CodecError> {
        let prelude = Prelude::read(bytes, limits)?;
        prelude.check_length(bytes.len() as u64)?;
        let header = Header::read(bytes, prelude, limits)?;
        for entry in &header.entries {
            entry.check_length(&bytes[entry.offset as usize..][..entry.head_bytes() as usize], limits)?;
        }
        Ok(Self { bytes, header: Cow::Owned(header), verified: false })
    }

    /// The same, with the checksums of all sections checked.
    pub(crate) fn verified(&self) -> Result<Container<'_>, CodecError> {
        for entry in &self.header.entries {
            self.payload(entry)?;
        }
        Ok(Container::beginning(self.bytes, &self.header))
    }

    /// The kind, encoding and bytes of a section; the bytes are checked against their checksum.
    pub(crate) fn section(&self, section: Section) -> Result<(Kind, Encoding, &'a [u8]), CodecError> {
        self.layer(section, 0)
    }

    /// As [`Container::section`], for one of the layers.
    pub(crate) fn layer(&self, section: Section, layer: usize) -> Result<(Kind, Encoding, &'a [u8]), CodecError> {
        let entry = self.header.entry(section, layer)?;
        Ok((entry.kind, entry.encoding, self.payload(entry)?))
    }

    /// The bytes of an entry of the table, checked against their checksum.
    fn payload(&self, entry: &Entry) -> Result<&'a [u8], CodecError> {
        let needed = entry.end();
        let available = self.bytes.len() as u64;
        if needed > available {
            let (section, field) = (entry.section.name(), "the section".into());
            return Err(CodecError::Truncated { section, field, needed, available });
        }
        let payload = &self.bytes[entry.offset as usize..needed as usize];
        if !self.verified {
            entry.check(crc32c::crc32c(payload))?;
        }
        Ok(payload)
    }
}

impl Entry {
    /// Refuses another checksum than that of the table.
    pub(crate) fn check(&self, computed: u32) -> Result<(), CodecError> {
        if computed == self.crc {
            return Ok(());
        }
        Err(CodecError::Checksum { section: self.section.name(), stored: self.crc, computed })
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
        let before = entries.iter().find(|entry| entry.section == section);
        if before.is_some() && !section.is_layered() {
            return Err(CodecError::DuplicateSection { section: name });
        }
        if let Some(first) = before {
            check_further_layer(first, kind, encoding)?;
        } else if kind == Kind::ShContinued {
            return Err(CodecError::invalid(
                "table",
                "kind of the first sh",
                kind.name(),
                "one with a coding of its own",
            ));
        }
        if bytes > end - offset {
            let (needed, available) = (bytes, end - offset);
            return Err(CodecError::Truncated { section: name, field: "the section".into(), needed, available });
        }
        entries.push(Entry { section, kind, encoding, crc, offset, bytes });
        offset += bytes;
    }
    if end > offset {
        return Err(CodecError::TrailingBytes { section: "stream", bytes: end - offset });
    }
    let count = |section: Section| entries.iter().filter(|entry| entry.section == section).count();
    let (gaussians, sh) = (count(Section::Gaussians), count(Section::Sh));
    // Where one is missing altogether, it is named when it is read.
    if gaussians > 0 && sh > 0 && gaussians != sh {
        let expected = format!("{gaussians}, one for each gaussians section");
        return Err(CodecError::invalid("table", "number of sh sections", sh, expected));
    }
    Ok(entries)
}

/// Refuses kinds and encodings of a layer after the first that do not follow from the first.
fn check_further_layer(first: &Entry, kind: Kind, encoding: Encoding) -> Result<(), CodecError> {
    let expected = match first.kind {
        Kind::ShTables | Kind::ShNetworks => (Kind::ShContinued, Encoding::Quantized),
        _ => (first.kind, first.encoding),
    };
    if (kind, encoding) == expected {
        return Ok(());
    }
    let name = |(kind, encoding): (Kind, Encoding)| format!("{} ({})", kind.name(), encoding.name());
    let field = format!("kind of a further {} section", first.section.name());
    Err(CodecError::invalid("table", field, name((kind, encoding)), format!("{}, after the first one", name(expected))))
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

impl NewSection {
    /// Its entry in the table, where it begins at `offset`.
    fn entry(&self, offset: u64) -> Entry {
        let Self { kind, encoding, payload } = self;
        let (section, crc, bytes) = (kind.place().0, crc32c::crc32c(payload), payload.len() as u64);
        Entry { section, kind: *kind, encoding: *encoding, crc, offset, bytes }
    }
}

/// A stream of these sections, in their order, and its header.
pub(crate) fn write(
    meta: &SceneMeta,
    sections: &[&NewSection],
    limits: &Limits,
) -> Result<(Vec<u8>, Header), CodecError> {
    let mut writer = Writer::default();
    writer.bytes.resize(PRELUDE, 0);
    meta::write(meta, &mut writer);
    let meta_bytes = writer.bytes.len() - PRELUDE;
    at_most("meta", "length", meta_bytes as u64, limits.meta_bytes)?;
    let header_bytes = writer.bytes.len() + sections.len() * ENTRY;
    let mut entries: Vec<Entry> = Vec::new();
    for section in sections {
        let offset = entries.last().map_or(header_bytes as u64, Entry::end);
        entries.push(section.entry(offset));
    }
    entries.iter().for_each(|entry| entry.write(&mut writer));
    sections.iter().for_each(|section| writer.bytes.extend_from_slice(&section.payload));
    let mut bytes = writer.bytes;

    let mut prelude = Prelude {
        version: VERSION,
        flags: 0,
        section_count: sections.len() as u32,
        meta_bytes: meta_bytes as u32,
        file_bytes: bytes.len() as u64,
        crc: 0,
    };
    bytes[..PRELUDE_COVERED].copy_from_slice(&prelude.covered());
    prelude.crc = header_checksum(&bytes[..header_bytes]);
    bytes[PRELUDE_COVERED..PRELUDE].copy_from_slice(&prelude.crc.to_le_bytes());
    Ok((bytes, Header { prelude, meta: meta.clone(), entries }))
}
