use light4gs_codec::take::{NewSegment, SegmentTimes, Take, TakeMeta, write_take};
use light4gs_codec::{GaussianArrays, SceneData, decode, encode};

use super::*;
use crate::{ENTRY, Viewpoint};

fn quickstart() -> Vec<u8> {
    std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/quickstart.l4gs")).expect("a scene")
}

/// Opaque balls at these depths.
fn balls(depths: &[f32]) -> Vec<u8> {
    let count = depths.len();
    let gaussians = GaussianArrays {
        means: depths.iter().map(|&depth| [0.0, 0.0, depth]).collect(),
        log_scales: vec![[-3.0; 3]; count],
        quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
        opacity_logits: vec![3.0; count],
        sh_dc: vec![[0.1; 3]; count],
        ..GaussianArrays::default()
    };
    encode(&SceneData { gaussians, ..SceneData::default() }).expect("a stream")
}

fn segment(begin: f64, stream: Vec<u8>, hidden: Vec<bool>) -> NewSegment {
    let (end, stream_begin, stream_end) = (begin + 1.0, begin - 0.5, begin + 1.5);
    NewSegment { times: SegmentTimes { begin, end, stream_begin, stream_end, frames: 30 }, stream, hidden }
}

/// Two segments with a gap between them, and the bytes of the file.
fn take() -> (Take, Vec<u8>) {
    let segments = [segment(0.0, balls(&[4.0]), vec![true, false]), segment(2.0, balls(&[6.0, 3.0]), Vec::new())];
    let bytes = write_take(&TakeMeta::default(), &balls(&[5.0, 2.0]), &segments, 2).expect("a take");
    (Take::read(bytes.clone(), &take_limits()).expect("a take"), bytes)
}

/// The bytes of a segment in the file.
fn in_file((take, bytes): &(Take, Vec<u8>), number: usize) -> Vec<u8> {
    let range = take.index().segments()[number].range();
    bytes[range.start as usize..range.end as usize].to_vec()
}

fn opened(file: &(Take, Vec<u8>), numbers: &[usize]) -> OpenTake {
    let (take, _) = file;
    let mut open = OpenTake::new(take.index().clone());
    open.open_base(&take.base().expect("a base")).expect("a base");
    for &number in numbers {
        let begin = take.index().segments()[number].times.begin;
        let unpacked = open.unpack_segment(begin, &in_file(file, number)).expect("a segment");
        open.open_segment(begin, &unpacked).expect("a segment");
    }
    open
}

/// The depths that are drawn, back to front.
fn depths(open: &mut OpenTake, seconds: f64) -> Vec<f32> {
    open.show(seconds, 0);
    open.evaluate(seconds, 0, open.count());
    let viewpoint = Viewpoint { row: [0.0, 0.0, 1.0, 0.0], eye: [0.0; 3], spread: f32::INFINITY };
    let drawn = open.draw_list(&viewpoint).chunks_exact(ENTRY).filter(|entry| entry[3] > 0.0);
    drawn.map(|entry| entry[2]).collect()
}

#[test]
fn each_time_has_its_segment_and_what_it_hides() {
    let mut open = opened(&take(), &[0, 1]);
    assert_eq!(depths(&mut open, 0.5), [4.0, 2.0]);
    assert_eq!(depths(&mut open, 1.0), [5.0, 2.0], "a gap shows the base alone");
    assert_eq!(depths(&mut open, 2.0), [6.0, 5.0, 3.0, 2.0]);
    let counts = [0.5, 1.5, 2.5].map(|seconds| open.attributes_at(seconds).0.len() / (3 + 3 + 4 + 1 + 3));
    assert_eq!(counts, [2, 2, 4]);
    open.close_segment(2.0);
    assert_eq!(depths(&mut open, 2.0), [5.0, 2.0]);
}

#[test]
fn around_a_join_both_segments_are_drawn() {
    let segments = [segment(0.0, balls(&[4.0]), vec![true, false]), segment(1.0, balls(&[6.0, 3.0]), Vec::new())];
    let bytes = write_take(&TakeMeta::default(), &balls(&[5.0, 2.0]), &segments, 2).expect("a take");
    let file = (Take::read(bytes.clone(), &take_limits()).expect("a take"), bytes);
    let mut open = opened(&file, &[0, 1]);
    assert_eq!(depths(&mut open, 0.5), [4.0, 2.0]);
    assert_eq!(depths(&mut open, 1.0), [6.0, 5.0, 4.0, 3.0, 2.0]);
    assert_eq!(open.count(), 3);
    // The opacities of the list are those of all attributes.
    let opacities = |numbers: &[f32], count: usize| numbers[10 * count..11 * count].to_vec();
    let (numbers, _) = open.attributes_at(1.0);
    let viewpoint = Viewpoint { row: [0.0, 0.0, 1.0, 0.0], eye: [0.0; 3], spread: f32::INFINITY };
    let drawn: Vec<f32> = open.draw_list(&viewpoint).chunks_exact(ENTRY).map(|entry| entry[3]).take(5).collect();
    // Depths 5, 2 of the base, 4, 6, 3 of the segments.
    let by_depth = [3, 0, 2, 4, 1].map(|index| opacities(&numbers, 5)[index]);
    assert!(drawn.iter().zip(by_depth).all(|(drawn, all)| (drawn - all).abs() < 1e-6), "{drawn:?}, {by_depth:?}");
    assert!(drawn[0] < drawn[4] && (drawn[1] - drawn[0]).abs() < 1e-6);
    // One that has not come yet leaves its share to the other.
    open.close_segment(1.0);
    assert_eq!(depths(&mut open, 1.0), [4.0, 2.0]);
    assert_eq!(open.attributes_at(1.0).0.len(), 2 * 14);
}

#[test]
fn a_segment_stays_where_the_take_grows_and_another_take_is_not_taken() {
    let file = take();
    let mut open = opened(&file, &[1]);
    let index_of = |segments: &[NewSegment]| {
        let bytes = write_take(&TakeMeta::default(), &balls(&[5.0, 2.0]), segments, 5);
        Take::read(bytes.expect("a take"), &take_limits()).expect("a take").index().clone()
    };
    let [first, second] =
        [segment(0.0, balls(&[4.0]), vec![true, false]), segment(2.0, balls(&[6.0, 3.0]), Vec::new())];
    let third = segment(1.0, balls(&[7.0]), Vec::new());
    assert!(open.grow(index_of(&[first.clone(), second.clone(), third])));
    assert_eq!((depths(&mut open, 2.5).len(), open.index.segments().len()), (4, 3));
    assert!(!open.grow(index_of(std::slice::from_ref(&first))));
    assert!(!open.grow(index_of(&[first, segment(2.0, balls(&[6.5, 3.0]), Vec::new())])));
    assert_eq!((depths(&mut open, 2.5).len(), open.index.segments().len()), (4, 3));
    assert!(open.unpack_segment(0.7, &[]).unwrap_err().to_string().contains("begin of a segment"));
}

#[test]
fn damage_is_named() {
    let file = take();
    let open = opened(&file, &[]);
    let mut bytes = in_file(&file, 1);
    bytes[40] ^= 1;
    assert!(open.unpack_segment(2.0, &bytes).unwrap_err().to_string().contains("segment 1"));
    let mut open = OpenTake::new(file.0.index().clone());
    assert!(open.open_base(&balls(&[1.0])).is_err() && open.open_base(&quickstart()).is_err());
    assert!(open.open_segment(2.0, &[9, 0, 0, 0]).is_err());
    assert!(depths(&mut open, 2.5).is_empty());
}

/// The scene that draws is the one that was decoded, to the last bit.
#[test]
fn unpacking_changes_nothing() {
    let segment = Unpacked { scene: decode(&quickstart()).expect("a scene"), hidden: vec![true, false, true] };
    let bytes = segment.write().expect("bytes");
    assert_eq!(Unpacked::read(&bytes).expect("a segment"), segment);
}
