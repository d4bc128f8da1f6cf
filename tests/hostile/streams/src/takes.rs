//! Takes whose index somebody changed, with checksums that fit, and such that promise much.

use std::ops::Range;

use light4gs_codec::{
    CodecError, Limits, SceneData, decode, encode, info,
    take::{NewSegment, SegmentTimes, Take, TakeMeta, write_take},
};

use crate::{
    random::Random,
    sound,
    watch::{Decoder, Outcome},
};

/// Bytes of a row of the index, and before its checksum.
const ROW: usize = 64;
const COVERED: usize = ROW - 4;
/// Bytes of the prelude; its checksum is the last four.
const PRELUDE: usize = 44;

/// Makes takes.
#[derive(Debug)]
pub struct Takes {
    sound: Vec<u8>,
    /// The first block of the index.
    block: Range<usize>,
    seed: u64,
}

impl Takes {
    /// The takes of a seed.
    ///
    /// # Panics
    /// If a sound take is refused.
    pub fn new(seed: u64) -> Self {
        let mut streams = sound::streams().into_iter().map(|parts| parts.assemble());
        let gaussians = decode(&streams.next().expect("a sound stream")).expect("sound").gaussians;
        let count = gaussians.len();
        let base = encode(&SceneData { gaussians, ..SceneData::default() }).expect("sound");
        let segment = |(number, stream): (usize, Vec<u8>)| {
            let begin = 2.0 * number as f64;
            let times =
                SegmentTimes { begin, end: begin + 1.5, stream_begin: begin, stream_end: begin + 2.0, frames: 60 };
            NewSegment { times, stream, hidden: (0..count).map(|index| index % 2 == number % 2).collect() }
        };
        let segments: Vec<NewSegment> = streams.take(4).enumerate().map(segment).collect();
        let sound = write_take(&TakeMeta::default(), &base, &segments, 2).expect("sound");
        let index_end = Take::read(sound.clone(), &Limits::default()).expect("sound").index().base().start as usize;
        let block = index_end - ROW * (1 + segments.len() + 2)..index_end;
        Self { sound, block, seed }
    }

    /// Take `number`: how it was made, and its bytes.
    pub fn take(&self, number: u64) -> (&'static str, Vec<u8>) {
        let mut random = Random::new(self.seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut bytes = self.sound.clone();
        let rows = self.block.len() / ROW;
        let mut kind = "prelude";
        for _ in 0..1 + random.below(3) {
            let row = self.block.start + ROW * random.below(rows);
            kind = match random.below(5) {
                0 => {
                    put(&mut bytes, 10 + random.below(PRELUDE - 14), &number_at_an_edge(&mut random));
                    "prelude"
                }
                1 => {
                    let other = self.block.start + ROW * random.below(rows);
                    bytes.copy_within(other..other + ROW, row);
                    "a row twice"
                }
                2 => {
                    let end = bytes.len().next_multiple_of(ROW);
                    let capacity = random.scale(200_000);
                    bytes.resize(end + ROW * (1 + capacity as usize).min(2000), 0);
                    put(&mut bytes, self.block.start, &(end as u64).to_le_bytes());
                    put(&mut bytes, self.block.start + 8, &(capacity as u32).to_le_bytes());
                    "a further block"
                }
                3 => {
                    // Many Gaussians of the base, and so a long list of hidden ones.
                    let gaussians = random.scale(1 << 26) as u32;
                    put(&mut bytes, 36, &gaussians.to_le_bytes());
                    put(&mut bytes, row + 52, &(random.below(64) as u32).to_le_bytes());
                    "many hidden Gaussians"
                }
                _ => {
                    put(&mut bytes, row + 8 * random.below(7), &number_at_an_edge(&mut random));
                    "a field of a row"
                }
            };
        }
        if random.chance(10) {
            bytes.truncate(random.below(bytes.len()));
        }
        self.seal(&mut bytes);
        (kind, bytes)
    }

    /// Opens the bytes as a take, and decodes all that it has, one part after the other.
    pub fn run(bytes: &[u8], decoder: &Decoder) -> Outcome {
        let bytes = bytes.to_vec();
        decoder.watch(move || read(bytes))
    }

    /// Computes the checksums again, of all that is there.
    fn seal(&self, bytes: &mut [u8]) {
        let rows = bytes.get_mut(self.block.clone()).into_iter().flat_map(|rows| rows.chunks_exact_mut(ROW));
        for row in rows.filter(|row| row.iter().any(|&byte| byte != 0)) {
            let sum = crc32c::crc32c(&row[..COVERED]);
            put(row, COVERED, &sum.to_le_bytes());
        }
        if let Some(front) = bytes.get_mut(..self.block.start) {
            let sum = crc32c::crc32c_append(crc32c::crc32c(&front[..PRELUDE - 4]), &front[PRELUDE..]);
            put(front, PRELUDE - 4, &sum.to_le_bytes());
        }
    }
}

fn read(bytes: Vec<u8>) -> Result<(), CodecError> {
    let take = Take::read(bytes, &Limits::default())?;
    // What is refused must not hide what comes after it.
    let base = take.base().and_then(|base| take.index().check_base(&info(&base)?));
    let segments = (0..take.len()).map(|number| decode(&take.segment(number)?.stream).map(drop));
    let segments: Vec<Result<(), CodecError>> = segments.collect();
    base.and(segments.into_iter().collect())
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
