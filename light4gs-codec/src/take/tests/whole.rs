//! Takes that are written and read again.

use super::*;
use crate::{
    FurtherAttribute, MotionArrays, NamedTensor,
    take::{DrawnSegment, SegmentPart, drawn_together, is_take},
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
fn a_segment_fades_into_the_next_one() {
    let times = |begin: f64, stream_begin: f64, stream_end: f64| {
        let times = SegmentTimes { begin, end: begin + 2.0, stream_begin, stream_end, frames: 60 };
        NewSegment { times, stream: stream(1, 0), hidden: Vec::new() }
    };
    // Margins of half a second at 2, a margin of one side at 4, more than half of a segment at 6, a gap after 8.
    let segments =
        [times(0.0, 0.0, 2.5), times(2.0, 1.5, 4.0), times(4.0, 3.0, 9.0), times(6.0, 2.0, 9.0), times(9.0, 8.0, 11.0)];
    let take = read(&write_take(&meta(), &stream(1, 0), &segments, 0).expect("a take")).expect("a take");
    let drawn = |seconds: f64| take.drawn_at(seconds).iter().map(|one| (one.segment, one.weight)).collect::<Vec<_>>();
    for (seconds, segment) in [(0.0, 0), (1.5, 0), (2.5, 1), (3.0, 1), (4.0, 2), (5.0, 2), (7.0, 3), (7.9, 3), (9.0, 4)]
    {
        assert_eq!(drawn(seconds), [(segment, 1.0)], "{seconds}");
    }
    for (seconds, expected) in [
        (1.75, [(0, 0.75), (1, 0.25)]),
        (2.0, [(0, 0.5), (1, 0.5)]),
        (2.25, [(0, 0.25), (1, 0.75)]),
        (3.5, [(1, 0.5), (2, 0.5)]),
        (5.5, [(2, 0.75), (3, 0.25)]),
        (6.5, [(2, 0.25), (3, 0.75)]),
    ] {
        assert_eq!(drawn(seconds), expected, "{seconds}");
    }
    for seconds in [8.5, -1.0, 11.0, f64::NAN] {
        assert!(drawn(seconds).is_empty(), "{seconds}");
    }
    let DrawnSegment { weight, .. } = take.drawn_at(2.0_f64.next_up())[1];
    assert!((0.5..0.51).contains(&weight));
}

#[test]
fn base_and_segments_are_drawn_together() {
    let mut base = gaussians(3, 0);
    base.further.push(FurtherAttribute { name: "age".into(), width: 1, values: vec![0.0; 3], optional: true });
    let moving = gaussians(2, 1);
    let part = |hidden, moved, weight| SegmentPart { hidden, moved, weight };
    let drawn = drawn_together(&base, &[part(&[true, false, true], &moving, 1.0)]);
    assert_eq!(drawn.means, [base.means[1], moving.means[0], moving.means[1]]);
    assert_eq!((drawn.sh_degree, drawn.sh_rest.len()), (1, 27));
    assert_eq!((&drawn.sh_rest[..9], &drawn.sh_rest[9..]), (&[0.0; 9][..], &moving.sh_rest[..]));
    assert!(drawn.further.is_empty());
    // The other way round, and nothing hidden.
    let drawn = drawn_together(&moving, &[part(&[], &base, 1.0)]);
    assert_eq!((drawn.len(), &drawn.sh_rest[..18], &drawn.sh_rest[18..]), (5, &moving.sh_rest[..], &[0.0; 27][..]));
    assert_eq!(drawn_together(&moving, &[]), moving);
    // Two segments: what both hide is gone, what one hides has the other's weight, what none hides is as it was.
    let opaque = |count| GaussianArrays { opacity_logits: vec![2.0; count], ..gaussians(count, 0) };
    let [base, moving] = [opaque(3), opaque(1)];
    let halves = [part(&[true, true, false], &moving, 0.25), part(&[true, false, false], &moving, 0.75)];
    let logits = drawn_together(&base, &halves).opacity_logits;
    assert_eq!((logits.len(), logits[1]), (4, 2.0));
    assert!(logits[0] == logits[3] && logits[2] < logits[3] && logits[3] < 2.0, "{logits:?}");
}
