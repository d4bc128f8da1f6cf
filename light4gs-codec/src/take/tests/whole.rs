//! Takes that are written and read again.

use super::*;
use crate::{
    FurtherAttribute, MotionArrays, NamedTensor,
    take::{drawn_together, is_take},
};

#[test]
fn a_take_comes_back() {
    for (begins, spare) in [(&[][..], 0), (&[], 3), (&[4.0, 0.0, 9.0], 0), (&[2.0], 70)] {
        let bytes = take_of(begins, spare);
        assert!(is_take(&bytes));
        let mut segments: Vec<NewSegment> = begins.iter().map(|&begin| segment(begin)).collect();
        segments.sort_by(|a, b| a.times.begin.total_cmp(&b.times.begin));
        let found = contents(&bytes).expect("its contents");
        assert_eq!(found, Contents { meta: meta(), base: stream(10, 1), segments });
    }
}

#[test]
fn segments_are_found_by_their_times() {
    let take = read(&take_of(&[4.0, 0.0, 2.0, 9.0], 0)).expect("a take");
    let found = [-1.0, 0.0, 1.99, 2.0, 4.0, 5.999, 6.0, 8.9, 9.0, 11.0, f64::NAN].map(|t| take.segment_at(t));
    let [none, at] = [None, Some(0)];
    assert_eq!(found, [none, at, at, Some(1), Some(2), Some(2), none, none, Some(3), none, none]);
    assert_eq!(take.index().seconds(), 60.0);
    assert!(take.segment(4).unwrap_err().to_string().contains("less than 4"));
}

#[test]
fn times_of_a_stream_are_rounded_once() {
    let times = SegmentTimes { begin: 0.0, end: 3.0, stream_begin: 0.0, stream_end: 3.0, frames: 0 };
    assert_eq!(times.stream_time(1.0).to_bits(), ((1.0_f64 / 3.0) as f32).to_bits());
    assert_eq!(times.stream_time(-0.0).to_bits(), 0);
    assert_eq!(times.stream_time(3.0 - 1e-12), 1.0);
    assert_eq!([f64::NAN, f64::NEG_INFINITY, f64::INFINITY].map(|t| times.stream_time(t)), [0.0, 0.0, 1.0]);
}

#[test]
fn the_index_is_read_from_the_first_bytes_alone() {
    let bytes = take_of(&[0.0, 2.0], 2);
    let (index, count) = fetched(&bytes).expect("an index");
    assert_eq!(index, index_of(&bytes));
    // The prelude, and then all before the base.
    assert_eq!(count, 44 + index.base().start);
    let mut reader = IndexReader::new(&Limits::default());
    assert!(reader.push(&bytes[..50]).is_err(), "more than it needs");
    assert!(reader.push(&bytes[..43]).is_err(), "less than it needs");
    assert!(reader.finish(bytes.len() as u64).is_err(), "not complete");
}

#[test]
fn what_cannot_be_shown_is_not_written() {
    let base = stream(10, 1);
    let write = |change: &dyn Fn(&mut NewSegment)| {
        let mut new = segment(2.0);
        change(&mut new);
        let error = write_take(&meta(), &base, &[segment(0.0), new], 0).expect_err("a refusal").to_string();
        assert!(error.contains("take"), "{error}");
        error
    };
    assert!(write(&|new| new.times.begin = 1.5).contains("only one segment at a time"));
    assert!(write(&|new| new.times.end = 2.0).contains("0 or more to something later"));
    assert!(write(&|new| new.times.begin = -1.0).contains("0 or more"));
    assert!(write(&|new| new.times.stream_begin = 2.1).contains("within those of its stream"));
    assert!(write(&|new| new.times.stream_end = f64::NAN).contains("stream_end of a segment is NaN"));
    assert!(write(&|new| new.times.end = 2e9).contains("within ±1e9"));
    assert!(write(&|new| new.times.frames = 1_000_000).contains("at most 100000"));
    assert!(write(&|new| new.hidden.truncate(9)).contains("segment 1 of the take: take: length of hidden is 9"));
    assert!(write(&|new| new.stream[40] ^= 1).contains("checksum"));
    let motion = MotionArrays {
        kind: "test".into(),
        network: None,
        tensors: vec![NamedTensor { name: "a".into(), shape: vec![1], values: vec![0.0] }],
    };
    let moving = encode(&SceneData { motion, ..SceneData::default() }).expect("a stream");
    let error = write_take(&meta(), &moving, &[], 0).expect_err("a base that moves").to_string();
    assert!(error.contains("base of the take: motion: kind is \"test\""), "{error}");
    assert!(write_take(&TakeMeta { fps: -1.0, ..meta() }, &base, &[], 0).is_err());
    assert!(write_take(&TakeMeta { seconds: f64::NAN, ..meta() }, &base, &[], 0).is_err());
    assert!(write_take(&TakeMeta { name: "a\u{1b}".into(), ..meta() }, &base, &[], 0).is_err());
    assert!(write_take(&meta(), &base, &[], u32::MAX).is_err());
}

#[test]
fn readers_of_streams_and_of_takes_name_the_other() {
    let error = crate::decode(&take_of(&[], 0)).expect_err("a take is no stream");
    assert_eq!(error.kind(), "is-take");
    assert!(error.to_string().contains("take::Take"), "{error}");
    let error = read(&stream(1, 0)).expect_err("a stream is no take");
    assert_eq!(error.kind(), "not-take");
    assert!(error.to_string().contains("read_file"), "{error}");
}

#[test]
fn base_and_segment_are_drawn_together() {
    let mut base = gaussians(3, 0);
    base.further.push(FurtherAttribute { name: "age".into(), width: 1, values: vec![0.0; 3], optional: true });
    let moving = gaussians(2, 1);
    let drawn = drawn_together(&base, &[true, false, true], Some(&moving));
    assert_eq!(drawn.means, [base.means[1], moving.means[0], moving.means[1]]);
    assert_eq!((drawn.sh_degree, drawn.sh_rest.len()), (1, 27));
    assert_eq!((&drawn.sh_rest[..9], &drawn.sh_rest[9..]), (&[0.0; 9][..], &moving.sh_rest[..]));
    assert!(drawn.further.is_empty());
    // The other way round, and nothing hidden.
    let drawn = drawn_together(&moving, &[], Some(&base));
    assert_eq!((drawn.len(), &drawn.sh_rest[..18], &drawn.sh_rest[18..]), (5, &moving.sh_rest[..], &[0.0; 27][..]));
    assert_eq!(drawn_together(&moving, &[], None), moving);
}
