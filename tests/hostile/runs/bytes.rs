//! Damage to plain bytes.

use rand::Rng;

/// Changes bytes in one of the ways in which files are damaged, and says how.
pub fn mutate(bytes: &[u8], random: &mut impl Rng) -> (Vec<u8>, String) {
    let mut out = bytes.to_vec();
    let length = out.len();
    if length == 0 {
        out.push(random.random());
        return (out, "a byte in an empty file".to_owned());
    }
    let at = random.random_range(0..length);
    let what = match random.random_range(0..6) {
        0 => {
            out.truncate(at);
            format!("cut to {at} bytes")
        }
        1 => {
            let bit = random.random_range(0..8);
            out[at] ^= 1 << bit;
            format!("bit {bit} of byte {at} flipped")
        }
        2 => {
            let end = (at + random.random_range(1..64)).min(length);
            out[at..end].fill(if random.random() { 0xff } else { 0 });
            format!("bytes {at} to {end} overwritten")
        }
        3 => {
            let count = random.random_range(1..32);
            out.splice(at..at, (0..count).map(|_| random.random()));
            format!("{count} bytes added at {at}")
        }
        4 => {
            let end = (at + random.random_range(1..64)).min(length);
            out.drain(at..end);
            format!("bytes {at} to {end} removed")
        }
        _ => {
            let count = random.random_range(1..200);
            out = (0..count).map(|_| random.random()).collect();
            format!("{count} random bytes in its place")
        }
    };
    (out, what)
}
