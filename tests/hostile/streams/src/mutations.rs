//! Changes to valid streams.

use crate::{
    parts::{Parts, varint},
    random::Random,
};

/// Flips some bits.
pub(crate) fn flip(bytes: &mut [u8], random: &mut Random) {
    for _ in 0..random.scale(8) {
        let at = random.below(bytes.len());
        if let Some(byte) = bytes.get_mut(at) {
            *byte ^= 1 << random.below(8);
        }
    }
}

/// One mutation; returns its name.
pub(crate) fn mutate(parts: &mut Parts, sound: &[Parts], random: &mut Random) -> &'static str {
    if parts.sections.is_empty() {
        return "nothing left";
    }
    let count = parts.sections.len();
    let section = random.below(count);
    match random.below(16) {
        0..4 => {
            flip(&mut parts.sections[section].payload, random);
            "flip"
        }
        4 | 5 => {
            // Most counts are in the heads of sections.
            let payload = &mut parts.sections[section].payload;
            let head = payload.len().min(48);
            flip(&mut payload[..head], random);
            "flip in a head"
        }
        6..9 => {
            number(&mut parts.sections[section].payload, random);
            "number"
        }
        9 => {
            let other = &sound[random.below(sound.len())].sections;
            let from = &other[random.below(other.len())].payload;
            splice(&mut parts.sections[section].payload, from, random);
            "splice"
        }
        10 => {
            let payload = &mut parts.sections[section].payload;
            let length = random.below(payload.len() + 1);
            payload.truncate(length);
            "cut short"
        }
        11 => {
            let length = random.scale(1 << 12) as usize;
            let more = random.bytes(length);
            parts.sections[section].payload.extend(more);
            "appended"
        }
        12 => {
            let other = &sound[random.below(sound.len())].sections;
            let from = other[random.below(other.len())].clone();
            match random.below(3) {
                0 => parts.set(from.id, from.kind, from.encoding, from.payload),
                1 => parts.sections.swap(section, count - 1),
                _ => parts.sections[section].payload = from.payload,
            }
            "section of another"
        }
        13 => {
            let section = &mut parts.sections[section];
            match random.below(3) {
                0 => section.kind = random.below(5) as u8,
                1 => section.encoding = random.below(3) as u8,
                _ => section.id = random.below(9) as u16,
            }
            "kind or encoding"
        }
        14 => {
            let length = random.scale(1 << 10) as usize;
            parts.sections[section].payload = random.bytes(length);
            "random bytes"
        }
        _ => {
            if random.chance(2) {
                flip(&mut parts.meta, random);
            } else {
                number(&mut parts.meta, random);
            }
            "meta"
        }
    }
}

/// Numbers at the ends of types and limits.
fn edge(random: &mut Random) -> u64 {
    let power = 1u64 << random.below(34);
    match random.below(4) {
        0 => power,
        1 => power - 1,
        2 => power + 1,
        _ => random.pick(&[0, 1, 2, 255, 65_535, 65_536, u32::MAX.into(), 1 << 40, u64::MAX]),
    }
}

/// Replaces a count or a length somewhere, most often near the beginning: as a varint, a `u32` or an `f32`.
fn number(bytes: &mut Vec<u8>, random: &mut Random) {
    let near = bytes.len().min(if random.chance(3) { usize::MAX } else { 64 });
    let at = random.below(near);
    let (count, new) = match random.below(3) {
        0 => {
            let length = bytes[at.min(bytes.len())..].iter().take_while(|byte| **byte >= 0x80).count() + 1;
            (length, varint(edge(random)))
        }
        1 => (4, (edge(random) as u32).to_le_bytes().to_vec()),
        _ => {
            let floats = [0.0, -0.0, 1.0, -1.0, 1e-45, 1e-38, 1e-20, 1e30, 3e38, f32::NAN, f32::INFINITY];
            (4, random.pick(&floats).to_le_bytes().to_vec())
        }
    };
    let end = (at + count).min(bytes.len());
    bytes.splice(at..end, new);
}

/// Copies, inserts or repeats some bytes.
fn splice(bytes: &mut Vec<u8>, from: &[u8], random: &mut Random) {
    let start = random.below(from.len());
    let count = (random.scale(64) as usize).min(from.len() - start);
    let at = random.below(bytes.len() + 1);
    let replaced = if random.chance(2) { count.min(bytes.len() - at) } else { 0 };
    bytes.splice(at..at + replaced, from[start..start + count].iter().copied());
}
