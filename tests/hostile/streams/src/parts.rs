//! A stream taken apart, and put together again with correct checksums (docs/format.md).

const PRELUDE: usize = 32;
const ENTRY: usize = 16;

/// A section of a stream.
#[derive(Clone, Debug)]
pub struct Section {
    /// Its number.
    pub id: u16,
    /// The kind of its contents.
    pub kind: u8,
    /// The form in which its numbers are stored.
    pub encoding: u8,
    /// Its bytes.
    pub payload: Vec<u8>,
}

/// A stream without lengths and checksums.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The scene meta.
    pub meta: Vec<u8>,
    /// The sections.
    pub sections: Vec<Section>,
}

impl Parts {
    /// Takes a valid stream apart.
    ///
    /// # Panics
    /// If the stream has no table or ends early.
    pub fn of(bytes: &[u8]) -> Self {
        let u32_at = |at: usize| u32::from_le_bytes(*bytes[at..].first_chunk().expect("four bytes")) as usize;
        let (count, meta) = (u32_at(12), u32_at(16));
        let table = PRELUDE + meta;
        let mut start = table + ENTRY * count;
        let section = |index: usize| {
            let entry = table + ENTRY * index;
            let length = u32_at(entry + 8);
            start += length;
            Section {
                id: u16::from_le_bytes([bytes[entry], bytes[entry + 1]]),
                kind: bytes[entry + 2],
                encoding: bytes[entry + 3],
                payload: bytes[start - length..start].to_vec(),
            }
        };
        Self { sections: (0..count).map(section).collect(), meta: bytes[PRELUDE..table].to_vec() }
    }

    /// The section with a number, if it is there.
    pub fn section(&mut self, id: u16) -> Option<&mut Section> {
        self.sections.iter_mut().find(|section| section.id == id)
    }

    /// Replaces a section, or adds it.
    pub fn set(&mut self, id: u16, kind: u8, encoding: u8, payload: Vec<u8>) {
        self.sections.retain(|section| section.id != id);
        self.sections.push(Section { id, kind, encoding, payload });
        self.sections.sort_by_key(|section| section.id);
    }

    /// The stream, with correct lengths and checksums.
    pub fn assemble(&self) -> Vec<u8> {
        let mut bytes = b"\x89L4GS\r\n\x1a\x01\0\0\0".to_vec();
        bytes.extend((self.sections.len() as u32).to_le_bytes());
        bytes.extend((self.meta.len() as u32).to_le_bytes());
        bytes.resize(PRELUDE, 0);
        bytes.extend(&self.meta);
        for Section { id, kind, encoding, payload } in &self.sections {
            bytes.extend(id.to_le_bytes());
            bytes.extend([*kind, *encoding]);
            bytes.extend(crc32c::crc32c(payload).to_le_bytes());
            bytes.extend((payload.len() as u64).to_le_bytes());
        }
        let header = bytes.len();
        self.sections.iter().for_each(|section| bytes.extend(&section.payload));
        let length = bytes.len() as u64;
        bytes[20..28].copy_from_slice(&length.to_le_bytes());
        let checksum = crc32c::crc32c_append(crc32c::crc32c(&bytes[..28]), &bytes[PRELUDE..header]);
        bytes[28..PRELUDE].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }
}

/// An unsigned integer in groups of seven bits, lowest first.
pub fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}
