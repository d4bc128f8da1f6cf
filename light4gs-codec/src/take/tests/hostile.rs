//! Indexes that somebody made up.

use proptest::{collection::vec, prelude::*};

use super::*;

/// Numbers that are at the edge of what is allowed.
fn number() -> impl Strategy<Value = u64> {
    let times = [0.0, 1.0, 2.5, -1.0, 1e9, f64::NAN, f64::INFINITY, f64::MAX];
    prop_oneof![
        any::<u64>(),
        0..2048_u64,
        (0..64_u32).prop_map(|bits| (1 << bits) - 1),
        (0..64_u64).prop_map(|row| 64 * row),
        (0..times.len()).prop_map(move |index| times[index].to_bits()),
    ]
}

proptest! {
    /// Changes with checksums that fit, so that what is behind them is reached.
    #[test]
    fn changed_indexes_are_read_or_refused(changes in vec((0..1200_usize, number(), 1..9_usize), 1..8), grows in any::<bool>()) {
        let mut bytes = take_of(&[0.0, 4.0], 1);
        if grows {
            bytes = appended::grown(&bytes, &[8.0, 20.0, 30.0]);
        }
        for (at, value, count) in changes {
            let at = at % (bytes.len() - 8);
            bytes[at..at + count.min(8)].copy_from_slice(&value.to_le_bytes()[..count.min(8)]);
        }
        seal(&mut bytes);
        if let Err(error) = contents(&bytes) {
            prop_assert!(!error.is_internal(), "{}", error);
        }
    }

    #[test]
    fn bytes_without_any_sense_are_refused(bytes in vec(any::<u8>(), 0..400)) {
        let mut bytes = [&crate::TAKE_MAGIC[..], &[1, 0, 0, 0], &bytes].concat();
        seal(&mut bytes);
        prop_assert!(contents(&bytes).is_err());
    }
}

/// A reader asks for no more bytes than the limit of slots allows, whatever the prelude promises.
#[test]
fn what_is_promised_is_bounded() {
    let mut bytes = take_of(&[], 0);
    for capacity in [100_000_u32, 100_001, u32::MAX] {
        bytes[16..20].copy_from_slice(&capacity.to_le_bytes());
        let front = (index_of(&take_of(&[], 0)).base().start + 64 * u64::from(capacity)).to_le_bytes();
        bytes[20..28].copy_from_slice(&front);
        let mut reader = IndexReader::new(&Limits::default());
        let answer = reader.push(&bytes[..44]);
        assert_eq!(answer.is_ok(), capacity == 100_000, "{answer:?}");
        assert!(reader.needed().expect("more bytes").end < 6_500_000);
    }
}

/// A chain of blocks ends with the file, or with the limit of slots.
#[test]
fn a_chain_of_blocks_ends() {
    let mut bytes = take_of(&[], 0);
    let end = bytes.len().next_multiple_of(64);
    let first_link = index_of(&bytes).room.last_link as usize;
    bytes.resize(end + 128 * 2000, 0);
    let link = |to: usize| super::super::row::Link { offset: to as u64, capacity: 1 }.write();
    bytes[first_link..first_link + 64].copy_from_slice(&link(end));
    for block in 0..1999 {
        let at = end + 128 * block;
        bytes[at..at + 64].copy_from_slice(&link(at + 128));
    }
    assert_eq!(read(&bytes).expect("a long chain").index().room.capacity, 2000);
    let few = Limits { segments: 1000, ..Limits::default() };
    assert_eq!(Take::read(bytes, &few).expect_err("too long a chain").kind(), "over-limit");
}
