//! What happens to a file by itself: flipped bits, cuts, ranges from elsewhere. No checksum is computed again.

use super::parts::ROW;
use crate::{mutations, random::Random};

/// Damages a take, and returns how. `edges` are places where parts of it begin or end, `block` where its index does; `other` is
/// another take.
pub(super) fn damage(
    bytes: &mut Vec<u8>,
    edges: &[usize],
    block: usize,
    other: &[u8],
    random: &mut Random,
) -> &'static str {
    match random.below(9) {
        0 | 1 => {
            mutations::flip(bytes, random);
            "flip"
        }
        2 => {
            // The front is small beside the streams.
            let front = bytes.len().min(edges.first().copied().unwrap_or(usize::MAX));
            mutations::flip(&mut bytes[..front], random);
            "flip in the front"
        }
        3 => {
            bytes.truncate(random.below(bytes.len()));
            "cut"
        }
        4 => {
            let edge = edges[random.below(edges.len())];
            bytes.truncate((edge + random.below(5)).saturating_sub(2));
            "cut at an edge"
        }
        5 => {
            let from = random.below(bytes.len());
            let length = (random.scale(1 << 12) as usize).min(bytes.len() - from);
            let to = random.below(bytes.len() - length + 1);
            bytes.copy_within(from..from + length, to);
            "a range from elsewhere"
        }
        6 => {
            let from = random.below(other.len());
            let length = random.scale(1 << 12) as usize;
            let to = random.below(bytes.len());
            // The same place of another file is likely, where a file is written anew.
            let from = if random.chance(2) { to.min(other.len()) } else { from };
            let range = &other[from..other.len().min(from + length)];
            bytes.iter_mut().skip(to).zip(range).for_each(|(byte, &new)| *byte = new);
            "a range of another take"
        }
        7 => {
            // Blocks of a disk that were not written, small ones so that whole rows of the index are hit.
            let size = random.pick(&[ROW, ROW, 512, 4096]);
            let near = if random.chance(2) { block + 16 * ROW } else { bytes.len() };
            let at = random.below(near.min(bytes.len()).div_ceil(size)) * size;
            let end = bytes.len().min(at + size * (1 + random.below(2)));
            bytes[at.min(end)..end].fill(random.pick(&[0, 0, 0, 0xff]));
            "a block that was not written"
        }
        _ => {
            let at = random.below(bytes.len());
            let length = (random.scale(1 << 8) as usize).min(bytes.len() - at);
            if random.chance(2) {
                bytes.drain(at..at + length);
            } else {
                let more = random.bytes(length);
                bytes.splice(at..at, more);
            }
            "bytes lost or put in"
        }
    }
}
