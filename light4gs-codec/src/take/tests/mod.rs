//! Tests of takes.

mod appended;
mod damaged;
mod front;
mod hidden;
mod hostile;
mod whole;

use super::{IndexReader, NewSegment, SegmentTimes, Take, TakeIndex, TakeMeta, write_take};
use crate::{CodecError, GaussianArrays, Limits, SceneData, encode};

/// A stream of Gaussians in a row, which have harmonics of a degree.
fn stream(count: usize, sh_degree: u8) -> Vec<u8> {
    encode(&SceneData { gaussians: gaussians(count, sh_degree), ..SceneData::default() }).expect("a stream")
}

fn gaussians(count: usize, sh_degree: u8) -> GaussianArrays {
    let numbers = |width: usize| (0..count * width).map(|index| index as f32 / 8.0).collect::<Vec<f32>>();
    GaussianArrays {
        means: numbers(3).as_chunks().0.to_vec(),
        log_scales: numbers(3).as_chunks().0.to_vec(),
        quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
        opacity_logits: numbers(1),
        sh_dc: numbers(3).as_chunks().0.to_vec(),
        sh_degree,
        sh_rest: numbers(3 * crate::sh_rest_coefficients(sh_degree)),
        further: Vec::new(),
    }
}

/// A segment of two seconds, with a margin of half a second, that hides every third Gaussian of a base of 10.
fn segment(begin: f64) -> NewSegment {
    let times =
        SegmentTimes { begin, end: begin + 2.0, stream_begin: begin - 0.5, stream_end: begin + 2.5, frames: 90 };
    NewSegment { times, stream: stream(begin as usize + 1, 0), hidden: (0..10).map(|index| index % 3 == 0).collect() }
}

fn meta() -> TakeMeta {
    let extra = [("camera".to_owned(), "a rig\nof six".to_owned())].into();
    TakeMeta { name: "a take".into(), fps: 30.0, seconds: 60.0, extra }
}

/// A take with segments that begin at these times.
fn take_of(begins: &[f64], spare: u32) -> Vec<u8> {
    let segments: Vec<NewSegment> = begins.iter().map(|&begin| segment(begin)).collect();
    write_take(&meta(), &stream(10, 1), &segments, spare).expect("a take")
}

fn read(bytes: &[u8]) -> Result<Take, CodecError> {
    Take::read(bytes.to_vec(), &Limits::default())
}

/// Everything that a take has, or the first error.
#[derive(Debug, PartialEq)]
struct Contents {
    meta: TakeMeta,
    base: Vec<u8>,
    segments: Vec<NewSegment>,
}

fn contents(bytes: &[u8]) -> Result<Contents, CodecError> {
    let take = read(bytes)?;
    let base = take.base()?.into_owned();
    take.index().check_base(&crate::info(&base)?)?;
    let segment = |index| {
        let segment = take.segment(index)?;
        crate::info(&segment.stream)?;
        Ok(NewSegment { times: segment.times, stream: segment.stream.into_owned(), hidden: segment.hidden })
    };
    let segments = (0..take.len()).map(segment).collect::<Result<_, CodecError>>()?;
    Ok(Contents { meta: take.meta().clone(), base, segments })
}

fn index_of(bytes: &[u8]) -> TakeIndex {
    read(bytes).expect("a take").index().clone()
}

/// Computes the checksums of the header and of all rows that are in use again. The bytes need not be a take.
fn seal(bytes: &mut [u8]) {
    let (Some(&meta_bytes), true) = (bytes.get(12..).and_then(|rest| rest.first_chunk::<4>()), bytes.len() >= 44)
    else {
        return;
    };
    let block = (44 + u64::from(u32::from_le_bytes(meta_bytes))).next_multiple_of(64) as usize;
    let Some(rest) = bytes.get(44..block) else { return };
    let sum = crc32c::crc32c_append(crc32c::crc32c(&bytes[..40]), rest);
    bytes[40..44].copy_from_slice(&sum.to_le_bytes());
    // Blocks that were appended as well: rows are at multiples of 64 everywhere.
    let capacity = u32::from_le_bytes([bytes[16], bytes[17], bytes[18], bytes[19]]) as usize;
    let mut at = Some((block, capacity));
    for _ in 0..10 {
        let Some((offset, capacity)) = at.take() else { break };
        let Some(end) = capacity.checked_mul(64).and_then(|rows| rows.checked_add(offset)?.checked_add(64)) else {
            break;
        };
        let Some(rows) = bytes.get_mut(offset..end) else { break };
        for row in rows.chunks_exact_mut(64).filter(|row| row.iter().any(|&byte| byte != 0)) {
            let sum = crc32c::crc32c(&row[..60]);
            row[60..].copy_from_slice(&sum.to_le_bytes());
        }
        let next = u64::from_le_bytes(std::array::from_fn(|at| rows[at])) as usize;
        let slots = u32::from_le_bytes(std::array::from_fn(|at| rows[8 + at])) as usize;
        at = (next > 0).then_some((next, slots));
    }
}

/// Reads the index of a file of which only some ranges may be fetched, and returns how many bytes were.
fn fetched(bytes: &[u8]) -> Result<(TakeIndex, u64), CodecError> {
    let (mut reader, mut count) = (IndexReader::new(&Limits::default()), 0);
    while let Some(range) = reader.needed() {
        count += range.end - range.start;
        let end = (bytes.len() as u64).min(range.end);
        reader.push(&bytes[end.min(range.start) as usize..end as usize])?;
    }
    Ok((reader.finish(bytes.len() as u64)?, count))
}
