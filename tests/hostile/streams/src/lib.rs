//! Hostile streams by the thousand: changed copies of valid streams, and streams built as bombs, all with correct
//! checksums.
//!
//! Every input is determined by a seed and its number, so these two numbers are enough to report a finding. The decoder
//! reads each input at its default limits on one thread. Its memory is counted by the allocator, and its time by the
//! thread's own clock.
//!
//! | file | what |
//! |---|---|
//! | `random.rs` | numbers that follow from a seed |
//! | `parts.rs` | a stream taken apart, and put together with checksums that fit |
//! | `sound.rs` | sound streams to begin with |
//! | `mutations.rs` | changes to them |
//! | `bombs.rs` | streams that promise much with few bytes |
//! | `transfers.rs` | streams that come in pieces, cut anywhere and resumed anywhere |
//! | `takes/` | damaged and forged takes, what a reader must say of them, and records of them for readers in other languages |
//! | `watch.rs` | memory, time and panics of one decoding |

mod bombs;
mod mutations;
pub mod parts;
mod random;
mod sound;
pub mod takes;
pub mod transfers;
pub mod watch;

use random::Random;

/// Makes inputs.
#[derive(Debug)]
pub struct Inputs {
    sound: Vec<parts::Parts>,
    seed: u64,
}

impl Inputs {
    /// The inputs of a seed.
    pub fn new(seed: u64) -> Self {
        Self { sound: sound::streams(), seed }
    }

    /// Input `number`: how it was made, and its bytes.
    pub fn input(&self, number: u64) -> (&'static str, Vec<u8>) {
        let mut random = Random::new(self.seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut parts = self.sound[random.below(self.sound.len())].clone();
        if random.chance(40) {
            let name = bombs::arm(&mut parts, &mut random);
            if random.chance(4) {
                mutations::mutate(&mut parts, &self.sound, &mut random);
            }
            return (name, parts.assemble());
        }
        let mut name = "mutation";
        for _ in 0..1 + random.below(3) {
            name = mutations::mutate(&mut parts, &self.sound, &mut random);
        }
        let mut bytes = parts.assemble();
        if random.chance(20) {
            mutations::flip(&mut bytes, &mut random);
            name = "flip without a checksum";
        }
        (name, bytes)
    }
}
