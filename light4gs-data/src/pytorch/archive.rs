//! The ZIP archive that PyTorch has written since 1.6: `NAME/data.pkl`, and one file `NAME/data/KEY` for each storage,
//! not compressed.

use std::collections::BTreeMap;

use super::storage::Storages;
use super::{Problem, Saved, pickle, problem};

const END_SIZE: usize = 22;
const LONGEST_COMMENT: usize = u16::MAX as usize;

/// Little-endian numbers at an offset; errors where the file ends before them.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn slice(&self, at: u64, length: u64) -> Result<&'a [u8], Problem> {
        let range = usize::try_from(at).ok().zip(at.checked_add(length).and_then(|end| usize::try_from(end).ok()));
        range.and_then(|(begin, end)| self.0.get(begin..end)).ok_or_else(|| {
            problem("ZIP archive", format!("it ends before byte {}: it is truncated", at.saturating_add(length)))
        })
    }

    fn number(&self, at: u64, length: u64) -> Result<u64, Problem> {
        Ok(self.slice(at, length)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }
}

/// The data of every entry by name. Checksums are checked.
fn entries(bytes: &[u8]) -> Result<BTreeMap<String, &[u8]>, Problem> {
    let archive = Bytes(bytes);
    let searched = bytes.len().saturating_sub(END_SIZE + LONGEST_COMMENT);
    let tail = &bytes[searched..];
    let end = tail.windows(4).rposition(|window| window == b"PK\x05\x06").map(|at| (searched + at) as u64);
    let end = end.ok_or_else(|| problem("ZIP archive", "it has no list of entries at its end: it is truncated"))?;
    let (mut count, mut at) = (archive.number(end + 10, 2)?, archive.number(end + 16, 4)?);
    // Numbers that do not fit stand in a further record before this one.
    if let Some(locator) = end.checked_sub(20)
        && archive.slice(locator, 4)? == b"PK\x06\x07"
    {
        let record = archive.number(locator + 8, 8)?;
        let position = |offset: u64| record.checked_add(offset).unwrap_or(u64::MAX - 64);
        (count, at) = (archive.number(position(32), 8)?, archive.number(position(48), 8)?);
    }
    let mut found = BTreeMap::new();
    for _ in 0..count {
        if archive.slice(at, 4)? != b"PK\x01\x02" {
            return Err(problem("ZIP archive", format!("no entry where byte {at} should begin one")));
        }
        let field = |offset: u64, length: u64| archive.number(at + offset, length);
        let (method, checksum) = (field(10, 2)?, field(16, 4)?);
        let (mut stored, mut size) = (field(20, 4)?, field(24, 4)?);
        let (name_length, extra_length, comment_length) = (field(28, 2)?, field(30, 2)?, field(32, 2)?);
        let mut offset = field(42, 4)?;
        let name = String::from_utf8_lossy(archive.slice(at + 46, name_length)?).into_owned();
        // Sizes and offsets beyond 32 bits, in this order, as far as they exist.
        let mut extra = archive.slice(at + 46 + name_length, extra_length)?;
        while let [a, b, c, d, rest @ ..] = extra {
            let (kind, length) = (u16::from_le_bytes([*a, *b]), usize::from(u16::from_le_bytes([*c, *d])));
            let Some(values) = rest.get(..length) else { break };
            if kind == 1 {
                let mut wide = values.as_chunks::<8>().0.iter().map(|value| u64::from_le_bytes(*value));
                for number in [&mut size, &mut stored, &mut offset] {
                    if *number == u64::from(u32::MAX) {
                        *number = wide.next().unwrap_or(*number);
                    }
                }
            }
            extra = &rest[length..];
        }
        if method != 0 || stored != size {
            return Err(problem(name, "it is compressed, and PyTorch never writes it so"));
        }
        if archive.slice(offset, 4)? != b"PK\x03\x04" {
            return Err(problem(name, format!("no data where byte {offset} should begin them")));
        }
        let header = |field: u64| archive.number(offset.saturating_add(field), 2);
        let begin = offset.saturating_add(30 + header(26)? + header(28)?);
        let data = archive.slice(begin, size)?;
        if u64::from(crc32fast::hash(data)) != checksum {
            return Err(problem(name, "its checksum is another: the file is damaged"));
        }
        found.insert(name, data);
        at += 46 + name_length + extra_length + comment_length;
    }
    Ok(found)
}

pub(super) fn read(bytes: &[u8]) -> Result<Saved<'_>, Problem> {
    let entries = entries(bytes)?;
    let pickle = entries.keys().find(|name| *name == "data.pkl" || name.ends_with("/data.pkl"));
    let Some(pickle) = pickle else {
        let names: Vec<&str> = entries.keys().take(4).map(String::as_str).collect();
        return Err(problem("data.pkl", format!("the archive has none (it has {})", names.join(", "))));
    };
    let folder = &pickle[..pickle.len() - "data.pkl".len()];
    if let Some(order) = entries.get(&format!("{folder}byteorder"))
        && *order != b"little"
    {
        let order = String::from_utf8_lossy(order);
        return Err(problem(format!("{folder}byteorder"), format!("`{order}`, expected `little`")));
    }
    let (arena, root, _) = pickle::run(entries[pickle], pickle)?;
    let prefix = format!("{folder}data/");
    let storages = entries.iter().filter_map(|(name, data)| Some((name.strip_prefix(&prefix)?.to_owned(), *data)));
    Ok(Saved { arena, root, storages: Storages::new(storages.collect()) })
}
