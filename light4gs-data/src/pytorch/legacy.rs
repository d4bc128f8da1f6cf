//! The container of PyTorch before 1.6: five pickles one after the other, then the storages.

use std::collections::BTreeMap;

use super::pickle::{Object, run};
use super::storage::Storages;
use super::{Problem, Saved, problem};

/// The low 64 bits of the number that such a file begins with.
const MAGIC: i64 = 0x1950_a86a_20f9_469c_fc6c_u128 as i64;
const PROTOCOL: i64 = 1001;

pub(super) fn read(bytes: &[u8]) -> Result<Saved<'_>, Problem> {
    let mut rest = bytes;
    let mut next = |name: &str| {
        let (arena, root, length) = run(rest, name)?;
        rest = &rest[length..];
        Ok::<_, Problem>((arena, root))
    };
    for (name, expected) in [("magic number", MAGIC), ("protocol", PROTOCOL)] {
        let (arena, root) = next(name)?;
        if !matches!(arena.get(root), Object::Integer(number) if *number == expected) {
            return Err(problem(name, "it is another: this is a pickle, but not one that PyTorch wrote"));
        }
    }
    let (system, root) = next("system")?;
    let is = |id, text: &str| matches!(system.get(id), Object::Text(found) if found == text);
    if let Object::Dict(entries) = system.get(root)
        && entries
            .iter()
            .any(|(key, value)| is(*key, "little_endian") && matches!(system.get(*value), Object::Bool(false)))
    {
        return Err(problem("system.little_endian", "false, expected true"));
    }
    let (arena, root) = next("state dict")?;
    let (keys, list) = next("storage keys")?;
    let Object::List(list) = keys.get(list) else { return Err(problem("storage keys", "they are no list")) };
    let mut storages = BTreeMap::new();
    for key in list {
        let Object::Text(key) = keys.get(*key) else { return Err(problem("storage keys", "one is no text")) };
        let truncated = || problem(format!("storage {key}"), "the file ends before it does: it is truncated");
        let (count, values) = rest.split_at_checked(8).ok_or_else(truncated)?;
        let count = u64::from_le_bytes(count.try_into().expect("eight bytes"));
        let size = arena.bytes_a_number(key).unwrap_or(1) as u64;
        let length = count.checked_mul(size).and_then(|length| usize::try_from(length).ok()).ok_or_else(truncated)?;
        let (data, after) = values.split_at_checked(length).ok_or_else(truncated)?;
        storages.insert(key.clone(), data);
        rest = after;
    }
    Ok(Saved { arena, root, storages: Storages::new(storages) })
}
