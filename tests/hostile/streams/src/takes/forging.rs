//! What somebody puts into a take: streams and lists that were changed, with checksums that fit all the way up.

use super::parts::TakeParts;
use crate::{
    bombs, mutations,
    parts::{Parts, varint},
    random::Random,
};

/// Changes the base or a segment of a take, and returns what was changed, and whether it is a stream that promises much with few
/// bytes. `sound` are streams to take parts of.
pub(super) fn forge(take: &mut TakeParts, sound: &[Parts], random: &mut Random) -> (&'static str, bool) {
    if take.segments.is_empty() {
        return (stream(&mut take.base, sound, random, "base"), false);
    }
    let number = random.below(take.segments.len());
    let other = random.below(take.segments.len());
    match random.below(12) {
        0 => (stream(&mut take.base, sound, random, "base"), false),
        1 => {
            let mut parts = Parts::of(&take.base);
            bombs::arm(&mut parts, random);
            take.base = parts.assemble();
            ("base that promises much", true)
        }
        2 => {
            let mut parts = sound[random.below(sound.len())].clone();
            bombs::arm(&mut parts, random);
            take.segments[number].stream = parts.assemble();
            ("segment that promises much", true)
        }
        3 => {
            take.segments[number].stream = sound[random.below(sound.len())].assemble();
            ("segment of another stream", false)
        }
        4 => {
            take.segments[number].stream = take.base.clone();
            take.base = take.segments[other].stream.clone();
            ("segment for a base", false)
        }
        5 | 6 => {
            let hidden = &mut take.segments[number].hidden;
            match random.below(4) {
                0 => mutations::flip(hidden, random),
                1 => hidden.truncate(random.below(hidden.len() + 1)),
                2 => {
                    let length = random.scale(1 << 7) as usize;
                    *hidden = random.bytes(length);
                }
                _ => {
                    let more = varint(random.next());
                    hidden.extend(more);
                }
            }
            ("hidden list", false)
        }
        _ => (stream(&mut take.segments[number].stream, sound, random, "segment"), false),
    }
}

fn stream(bytes: &mut Vec<u8>, sound: &[Parts], random: &mut Random, kind: &'static str) -> &'static str {
    let mut parts = Parts::of(bytes);
    for _ in 0..1 + random.below(3) {
        mutations::mutate(&mut parts, sound, random);
    }
    *bytes = parts.assemble();
    kind
}
