//! Takes whose index somebody changed, with checksums that fit, and such that promise much.

use std::ops::Range;

use super::parts::{COVERED, PRELUDE, ROW};
use crate::random::Random;

/// Changes an index, the first block of which is at `block`, and returns what was changed.
pub(super) fn forge(bytes: &mut Vec<u8>, block: &Range<usize>, random: &mut Random) -> &'static str {
    let rows = block.len() / ROW;
    let mut kind = "prelude";
    for _ in 0..1 + random.below(3) {
        let row = block.start + ROW * random.below(rows);
        kind = match random.below(5) {
            0 => {
                put(bytes, 10 + random.below(PRELUDE - 14), &number_at_an_edge(random));
                "prelude"
            }
            1 => {
                let other = block.start + ROW * random.below(rows);
                bytes.copy_within(other..other + ROW, row);
                "a row twice"
            }
            2 => {
                let end = bytes.len().next_multiple_of(ROW);
                let capacity = random.scale(200_000);
                bytes.resize(end + ROW * (1 + capacity as usize).min(2000), 0);
                put(bytes, block.start, &(end as u64).to_le_bytes());
                put(bytes, block.start + 8, &(capacity as u32).to_le_bytes());
                "a further block"
            }
            3 => {
                // Many Gaussians of the base, and so a long list of hidden ones.
                let gaussians = random.scale(1 << 26) as u32;
                put(bytes, 36, &gaussians.to_le_bytes());
                put(bytes, row + 52, &(random.below(64) as u32).to_le_bytes());
                "many hidden Gaussians"
            }
            _ => {
                put(bytes, row + 8 * random.below(7), &number_at_an_edge(random));
                "a field of a row"
            }
        };
    }
    if random.chance(10) {
        bytes.truncate(random.below(bytes.len()));
    }
    seal(bytes, block);
    kind
}

/// Computes the checksums of prelude and rows again, of all that is there.
fn seal(bytes: &mut [u8], block: &Range<usize>) {
    let rows = bytes.get_mut(block.clone()).into_iter().flat_map(|rows| rows.chunks_exact_mut(ROW));
    for row in rows.filter(|row| row.iter().any(|&byte| byte != 0)) {
        let sum = crc32c::crc32c(&row[..COVERED]);
        put(row, COVERED, &sum.to_le_bytes());
    }
    if let Some(front) = bytes.get_mut(..block.start) {
        let sum = crc32c::crc32c_append(crc32c::crc32c(&front[..PRELUDE - 4]), &front[PRELUDE..]);
        put(front, PRELUDE - 4, &sum.to_le_bytes());
    }
}

/// A number that is at the edge of something.
fn number_at_an_edge(random: &mut Random) -> [u8; 8] {
    let number = match random.below(4) {
        0 => random.next(),
        1 => (1 << random.below(64)) - u64::from(random.chance(2)),
        2 => 64 * random.scale(1 << 20),
        _ => random.pick(&[0.0, 1.5, 2.0, -1.0, 1e9, 1e300, f64::NAN, f64::INFINITY]).to_bits(),
    };
    number.to_le_bytes()
}

/// Writes as much as there is room for.
fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes[at..].iter_mut().zip(new).for_each(|(byte, &new)| *byte = new);
}
