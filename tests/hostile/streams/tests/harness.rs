//! Tests of the harness itself.

use light4gs_codec::{SceneData, decode, encode};
use light4gs_hostile::{Inputs, parts::Parts};

#[test]
fn taking_apart_and_assembling_changes_nothing() {
    let bytes = encode(&SceneData::default()).unwrap();
    assert_eq!(Parts::of(&bytes).assemble(), bytes);
}

#[test]
fn repaired_checksums_are_accepted() {
    let bytes = encode(&SceneData::default()).unwrap();
    let mut parts = Parts::of(&bytes);
    parts.meta[4..8].copy_from_slice(&77u32.to_le_bytes());
    assert_eq!(decode(&parts.assemble()).unwrap().meta.frame_count, 77);
}

#[test]
fn inputs_follow_from_seed_and_number() {
    let (one, other) = (Inputs::new(3), Inputs::new(3));
    for number in [0, 7, 1000] {
        assert_eq!(one.input(number), other.input(number));
    }
}
