//! Damage of the index, and files that end too early.

use super::*;

/// All bytes before the base, one after the other.
#[test]
fn a_changed_byte_of_the_front_is_an_error_or_changes_nothing() {
    let bytes = take_of(&[0.0, 4.0], 2);
    let expected = contents(&bytes).expect("its contents");
    let front = index_of(&bytes).base().start as usize;
    for at in 0..front {
        for flipped in [1, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flipped;
            match contents(&damaged) {
                Ok(found) => assert_eq!(found, expected, "byte {at} ^ {flipped}"),
                Err(error) => assert!(!error.is_internal(), "byte {at}: {error}"),
            }
        }
    }
}

/// Every byte of a block that was appended.
#[test]
fn a_changed_byte_of_a_further_block_is_an_error_or_changes_nothing() {
    let bytes = super::appended::grown(&take_of(&[0.0], 0), &[3.0, 6.0]);
    let expected = contents(&bytes).expect("its contents");
    let index = index_of(&bytes);
    let begin = index.room.last_link as usize;
    for at in begin..begin + 4 * 64 {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        if let Ok(found) = contents(&damaged) {
            assert_eq!(found, expected, "byte {at}");
        }
    }
}

#[test]
fn a_changed_byte_of_a_segment_is_found() {
    let bytes = take_of(&[0.0, 4.0], 0);
    for place in index_of(&bytes).segments() {
        for at in place.range() {
            let mut damaged = bytes.clone();
            damaged[at as usize] ^= 4;
            let error = contents(&damaged).expect_err("a checksum");
            assert!(error.to_string().starts_with("segment ") && error.kind() == "checksum", "{error}");
        }
    }
}

#[test]
fn a_take_that_ends_too_early_is_refused_at_every_length() {
    let bytes = take_of(&[0.0, 4.0], 1);
    for length in 0..bytes.len() {
        let error = read(&bytes[..length]).expect_err("too short");
        assert!(matches!(error.kind(), "truncated" | "not-take"), "{length}: {error}");
    }
    // What is behind the last range does not matter: a killed append leaves it.
    let mut longer = bytes.clone();
    longer.extend([7; 100]);
    assert_eq!(contents(&longer).expect("its contents"), contents(&bytes).expect("its contents"));
}

#[test]
fn rules_of_the_index() {
    let refused = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = take_of(&[0.0, 4.0], 1);
        change(&mut bytes);
        seal(&mut bytes);
        read(&bytes).expect_err("a refusal").to_string()
    };
    let put = |bytes: &mut Vec<u8>, at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    let bytes = take_of(&[0.0, 4.0], 1);
    let front = index_of(&bytes).base().start as usize;
    let (link, slot) = (front - 4 * 64, front - 3 * 64);
    assert!(refused(&|bytes| bytes[8] = 2).contains("version 2"));
    assert!(refused(&|bytes| bytes[10] = 1).contains("flags"));
    assert!(refused(&|bytes| bytes[20] ^= 64).contains("offset of the base"));
    assert!(refused(&|bytes| bytes[16] = 4).contains("offset of the base"));
    assert!(refused(&|bytes| put(bytes, 28, &u64::MAX.to_le_bytes())).contains("length of the base"));
    assert!(refused(&|bytes| put(bytes, 28, &(1_u64 << 29).to_le_bytes())).contains("offset of a segment"));
    assert!(refused(&|bytes| bytes[39] = 0xff).contains("Gaussians of the base"));
    assert!(refused(&|bytes| put(bytes, link - 1, &[1])).contains("bytes after the meta"));
    let nan = f64::NAN.to_le_bytes();
    assert!(refused(&|bytes| put(bytes, slot, &nan)).contains("begin of a segment is NaN"));
    assert!(refused(&|bytes| put(bytes, slot + 8, &5.0_f64.to_le_bytes())).contains("times"));
    assert!(refused(&|bytes| put(bytes, slot + 32, &64_u64.to_le_bytes())).contains("offset of a segment is 64"));
    assert!(refused(&|bytes| put(bytes, slot + 40, &0_u64.to_le_bytes())).contains("length of a segment is 0"));
    assert!(refused(&|bytes| put(bytes, slot + 40, &(1_u64 << 29).to_le_bytes())).contains("needs"));
    assert!(refused(&|bytes| put(bytes, slot + 40, &u64::MAX.to_le_bytes())).contains("is accepted"));
    assert!(refused(&|bytes| put(bytes, slot + 52, &u32::MAX.to_le_bytes())).contains("hidden list"));
    // The second segment at the time of the first one.
    assert!(refused(&|bytes| put(bytes, slot + 64, &1.0_f64.to_le_bytes())).contains("within those of its stream"));
    assert!(
        refused(&|bytes| {
            let first = bytes[slot..slot + 32].to_vec();
            put(bytes, slot + 64, &first);
        })
        .contains("only one segment at a time")
    );
    // Links: to itself, to the base, to an odd place, to nothing, beyond the end, with too many slots.
    let link_to = |offset: u64, capacity: u32| {
        refused(&move |bytes| {
            put(bytes, link, &offset.to_le_bytes());
            put(bytes, link + 8, &capacity.to_le_bytes());
        })
    };
    let end = (bytes.len() as u64).next_multiple_of(64);
    assert!(link_to(link as u64, 1).contains("offset of a block"));
    assert!(link_to(front as u64, 1).contains("offset of a block"));
    assert!(link_to(end + 1, 1).contains("offset of a block"));
    assert!(link_to(end, 0).contains("slots of a further block"));
    assert!(link_to(end, 1).contains("needs 128 bytes"));
    assert!(link_to(u64::MAX - 63, 5).contains("offset of a block"));
    assert!(link_to(end, 100_000).contains("slots of the index"));
    assert!(refused(&|bytes| bytes[link + 20] = 1).contains("rest of a link"));
}
