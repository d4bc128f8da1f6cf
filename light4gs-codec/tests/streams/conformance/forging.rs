//! Files of the set that are made from others, see `tests/conformance/kit/forging.py`.

use crate::common::{ENTRY, forge_header, payload, put, table_at, u32_at};

const PRELUDE: usize = 32;
const SECTIONS: [&str; 6] = ["gaussians", "sh", "scene_coordinates", "motion", "feature_planes", "context_model"];

/// Bytes of a part that others replace.
pub(super) struct Edit {
    part: String,
    offset: usize,
    length: usize,
    new: Vec<u8>,
}

impl Edit {
    /// From `PART@OFFSET-LENGTH=HEX`.
    pub(super) fn parse(text: &str) -> Self {
        let (part, rest) = text.split_once('@').unwrap();
        let (offset, rest) = rest.split_once('-').unwrap();
        let (length, hex) = rest.split_once('=').unwrap();
        let byte = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
        Self {
            part: part.into(),
            offset: offset.parse().unwrap(),
            length: length.parse().unwrap(),
            new: (0..hex.len()).step_by(2).map(byte).collect(),
        }
    }

    fn apply(&self, bytes: &mut Vec<u8>) {
        bytes.splice(self.offset..self.offset + self.length, self.new.iter().copied());
    }
}

/// A legal stream after some edits; a take, which has no such parts, only after edits of the file.
pub(super) fn forge(bytes: &[u8], edits: &[Edit]) -> Vec<u8> {
    if edits.iter().all(|edit| edit.part == "file") {
        let mut forged = bytes.to_vec();
        edits.iter().for_each(|edit| edit.apply(&mut forged));
        return forged;
    }
    let mut parts = split(bytes);
    for edit in edits.iter().filter(|edit| !matches!(edit.part.as_str(), "header" | "file")) {
        let part = parts.iter_mut().find(|(name, _)| *name == edit.part);
        edit.apply(&mut part.unwrap_or_else(|| panic!("no part {}", edit.part)).1);
    }
    let mut forged = join(parts);
    edits.iter().filter(|edit| edit.part == "header").for_each(|edit| edit.apply(&mut forged));
    forge_header(&mut forged);
    edits.iter().filter(|edit| edit.part == "file").for_each(|edit| edit.apply(&mut forged));
    forged
}

/// The parts of a legal stream, in their order.
fn split(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let table = table_at(bytes);
    let count = u32_at(bytes, 12) as usize;
    let mut parts = vec![
        ("prelude".to_owned(), bytes[..PRELUDE].to_vec()),
        ("meta".to_owned(), bytes[PRELUDE..table].to_vec()),
        ("table".to_owned(), bytes[table..table + ENTRY * count].to_vec()),
    ];
    for index in 0..count {
        let number = bytes[table + ENTRY * index];
        let name = SECTIONS[usize::from(number) - 1];
        let before = (0..index).filter(|other| bytes[table + ENTRY * other] == number).count();
        let name = if before > 0 { format!("{name}_{}", before + 1) } else { name.to_owned() };
        parts.push((name, payload(bytes, index).to_vec()));
    }
    parts
}

/// The stream of these parts, with lengths and checksums of the sections. Entry `i` belongs to section `i`.
fn join(parts: Vec<(String, Vec<u8>)>) -> Vec<u8> {
    let mut parts = parts.into_iter().map(|(_, bytes)| bytes);
    let [mut forged, meta, mut table] = [(); 3].map(|()| parts.next().expect("prelude, meta and table"));
    let sections: Vec<Vec<u8>> = parts.collect();
    for (entry, section) in table.chunks_exact_mut(ENTRY).zip(&sections) {
        put(entry, 4, &crc32c::crc32c(section).to_le_bytes());
        put(entry, 8, &(section.len() as u64).to_le_bytes());
    }
    let (entries, meta_bytes) = ((table.len() / ENTRY) as u32, meta.len() as u32);
    forged.extend(meta);
    forged.extend(table);
    sections.into_iter().for_each(|section| forged.extend(section));
    let length = forged.len() as u64;
    put(&mut forged, 12, &entries.to_le_bytes());
    put(&mut forged, 16, &meta_bytes.to_le_bytes());
    put(&mut forged, 20, &length.to_le_bytes());
    forged
}
