//! Damaged and forged takes. Whatever happened to a file by itself, a reader gives an error or what the sound file shows; where
//! somebody made checksums that fit, it gives what all readers give.
//!
//! | file | what |
//! |---|---|
//! | `damage.rs` | flipped bits, cuts, ranges from elsewhere |
//! | `index.rs`, `forging.rs` | an index, a stream or a list that was changed, with checksums that fit |
//! | `parts.rs` | a take taken apart, and put together |
//! | `reading.rs` | what a take shows at some times |
//! | `record.rs` | takes for readers in other languages |

mod damage;
mod forging;
mod index;
mod parts;
mod reading;
mod record;

use std::ops::Range;

use light4gs_codec::{
    Limits, SceneData, decode, encode,
    take::{NewSegment, SegmentTimes, Take, TakeMeta, write_take},
};

pub use self::reading::{Answer, Reading, Sums};
pub use self::record::record;
use self::{
    parts::{COVERED, ROW, TakeParts},
    reading::Answer::{Refused, Shown},
};
use crate::{parts::Parts, random::Random, sound, watch::Decoder};

/// Segments of a forged take that are asked for.
const MOST_ASKED: usize = 16;

/// A take that was changed.
#[derive(Clone, Debug, PartialEq)]
pub struct DamagedTake {
    /// How it was made.
    pub kind: &'static str,
    /// The sound take that it was.
    pub sound: usize,
    /// Somebody changed it, and computed its checksums again.
    pub forged: bool,
    /// It has a stream that promises much with few bytes.
    pub bomb: bool,
    /// The file.
    pub bytes: Vec<u8>,
    /// Seconds to ask for.
    pub times: Vec<f64>,
}

/// Makes takes.
#[derive(Debug)]
pub struct Takes {
    sound: Vec<Sound>,
    streams: Vec<Parts>,
    seed: u64,
}

/// A take that is whole.
#[derive(Debug)]
struct Sound {
    bytes: Vec<u8>,
    /// Bytes of prelude, first block of the index, and base.
    front: usize,
    /// The first block of its index.
    block: Range<usize>,
    /// Where the base and each segment begin and end.
    edges: Vec<usize>,
    /// A time of each segment, and one of none.
    times: Vec<f64>,
}

impl Takes {
    /// The takes of a seed.
    ///
    /// # Panics
    /// If a sound take is refused.
    pub fn new(seed: u64) -> Self {
        let streams = sound::streams();
        let conformance = ["segments", "appended", "nothing"].map(|name| {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../conformance/streams/takes");
            std::fs::read(format!("{folder}/{name}.l4gs")).expect("a take of the conformance set")
        });
        let sound = [many_fields(&streams)].into_iter().chain(conformance).map(Sound::new);
        Self { sound: sound.collect(), streams, seed }
    }

    /// Number of the sound takes.
    pub fn sound_takes(&self) -> usize {
        self.sound.len()
    }

    /// A sound take, as if it was changed.
    ///
    /// # Panics
    /// If there is no such take.
    pub fn sound(&self, index: usize) -> DamagedTake {
        let Sound { bytes, times, .. } = &self.sound[index];
        let (bytes, times) = (bytes.clone(), times.clone());
        DamagedTake { kind: "sound", sound: index, forged: false, bomb: false, bytes, times }
    }

    /// Take `number`.
    pub fn take(&self, number: u64) -> DamagedTake {
        let mut random = Random::new(self.seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        // The one that has nothing is soon exhausted.
        let sound = random.pick(&[0, 0, 0, 1, 1, 1, 2, 2, 2, 3]);
        let mut take = self.sound(sound);
        let Sound { block, edges, .. } = &self.sound[sound];
        match random.below(4) {
            0 | 1 => {
                let other = &self.sound[random.below(self.sound.len())].bytes;
                take.kind = damage::damage(&mut take.bytes, edges, block.start, other, &mut random);
                return take;
            }
            2 => take.kind = index::forge(&mut take.bytes, block, &mut random),
            _ => {
                let mut parts = TakeParts::of(&take.bytes);
                (take.kind, take.bomb) = forging::forge(&mut parts, &self.streams, &mut random);
                take.bytes = parts.assemble();
            }
        }
        take.forged = true;
        if let Ok(read) = Take::read(take.bytes.clone(), &Limits::default()) {
            take.times = times_of(&read);
        }
        take
    }

    /// What is wrong with the answers of a reader, where that can be told from the sound take: `whole` are the answers for that one, at
    /// its times.
    pub fn fault(&self, take: &DamagedTake, answers: &[Answer], whole: &[Answer]) -> Option<&'static str> {
        if take.forged || self.has_front_of_another(take) {
            return None;
        }
        // The time after the last segment.
        let alone = whole.last();
        let erased = self.sound[take.sound].has_erased_rows(&take.bytes);
        let right = |(answer, whole): (&Answer, &Answer)| match answer {
            Refused(_) => true,
            // A slot of zeros is one that is not used yet.
            Shown(_) => answer == whole || erased && Some(answer) == alone,
            Answer::Large => answer == whole,
        };
        let all = answers.len() == whole.len() && answers.iter().zip(whole).all(right);
        (!all).then_some("wrong picture")
    }

    /// Whether a range of another take has replaced the whole front: then it is that take, and what it shows is right.
    fn has_front_of_another(&self, take: &DamagedTake) -> bool {
        let others = self.sound.iter().enumerate().filter(|(index, _)| *index != take.sound);
        others.map(|(_, other)| &other.bytes[..other.front]).any(|front| take.bytes.starts_with(front))
    }

    /// Reads a take, and says what is wrong with the answers. `whole` are those for the sound takes.
    pub fn run(&self, take: &DamagedTake, whole: &[Vec<Answer>], decoder: &Decoder) -> Reading {
        let mut reading = Reading::of(&take.bytes, &take.times, decoder);
        reading.outcome.wrong = self.fault(take, &reading.answers, &whole[take.sound]);
        reading
    }

    /// The answers for the sound takes.
    ///
    /// # Panics
    /// If one is refused.
    pub fn whole(&self, decoder: &Decoder) -> Vec<Vec<Answer>> {
        let answers = |index| {
            let DamagedTake { bytes, times, .. } = self.sound(index);
            let Reading { answers, .. } = Reading::of(&bytes, &times, decoder);
            assert!(answers.iter().all(|answer| matches!(answer, Shown(_))), "sound take {index}: {answers:?}");
            answers
        };
        (0..self.sound_takes()).map(answers).collect()
    }
}

impl Sound {
    fn new(bytes: Vec<u8>) -> Self {
        let take = Take::read(bytes.clone(), &Limits::default()).expect("sound");
        let base = take.index().base();
        let meta_bytes = u32::from_le_bytes(*bytes[12..].first_chunk().expect("four bytes")) as usize;
        let block = (parts::PRELUDE + meta_bytes).next_multiple_of(ROW)..base.start as usize;
        let front = base.end as usize;
        let ranges = take.index().segments().iter().map(|place| place.range()).chain([base]);
        let mut edges: Vec<usize> = ranges.flat_map(|range| [range.start as usize, range.end as usize]).collect();
        edges.sort_unstable();
        Self { times: times_of(&take), front, block, edges, bytes }
    }

    /// Whether a row of the index that was in use has become zeros as a whole.
    fn has_erased_rows(&self, bytes: &[u8]) -> bool {
        let mut rows = self.bytes.chunks_exact(ROW).zip(bytes.chunks_exact(ROW));
        // Nothing but a row of an index has its own checksum there.
        let is_row = |row: &[u8]| row[COVERED..] == crc32c::crc32c(&row[..COVERED]).to_le_bytes();
        rows.any(|(before, after)| is_row(before) && after.iter().all(|&byte| byte == 0))
    }
}

/// The middle of each segment, of the first ones where there are many, and a time after the last one.
fn times_of(take: &Take) -> Vec<f64> {
    let segments = take.index().segments();
    let middle = |times: SegmentTimes| times.begin + (times.end - times.begin) / 2.0;
    let after = segments.last().map_or(0.0, |last| last.times.end);
    segments.iter().take(MOST_ASKED).map(|place| middle(place.times)).chain([after]).collect()
}

/// A take of five segments with gaps, whose streams have nodes and other motion, and that hide every other Gaussian.
fn many_fields(streams: &[Parts]) -> Vec<u8> {
    let mut streams = streams.iter().map(Parts::assemble);
    let gaussians = decode(&streams.next().expect("a sound stream")).expect("sound").gaussians;
    let count = gaussians.len();
    let base = encode(&SceneData { gaussians, ..SceneData::default() }).expect("sound");
    let segment = |(number, stream): (usize, Vec<u8>)| {
        let begin = 2.0 * number as f64;
        let times = SegmentTimes { begin, end: begin + 1.5, stream_begin: begin, stream_end: begin + 2.0, frames: 60 };
        NewSegment { times, stream, hidden: (0..count).map(|index| index % 2 == number % 2).collect() }
    };
    let segments: Vec<NewSegment> = streams.take(5).enumerate().map(segment).collect();
    write_take(&TakeMeta::default(), &base, &segments, 2).expect("sound")
}
