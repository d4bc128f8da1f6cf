//! Takes that grow.

use super::*;
#[cfg(not(target_os = "unknown"))]
use crate::take::TakeFile;
use crate::take::append::Append;

fn plan(bytes: &[u8], begin: f64) -> Result<Append, CodecError> {
    Append::plan(&index_of(bytes), bytes.len() as u64, &segment(begin), &Limits::large())
}

/// The bytes with further segments.
pub(super) fn grown(bytes: &[u8], begins: &[f64]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for &begin in begins {
        let Append { tail, row_offset, row } = plan(&bytes, begin).expect("room");
        bytes.extend(tail);
        bytes[row_offset as usize..][..row.len()].copy_from_slice(&row);
    }
    bytes
}

#[test]
fn blocks_that_are_not_full_and_such_that_are() {
    let begins: Vec<f64> = (0..140).map(|index| 2.0 * f64::from((index * 37) % 140)).collect();
    for (spare, capacity) in [(0, 256), (1, 260), (5, 276)] {
        let bytes = grown(&take_of(&[], spare), &begins);
        let found = contents(&bytes).expect("its contents");
        assert_eq!(found.segments, (0..140).map(|index| segment(2.0 * f64::from(index))).collect::<Vec<_>>());
        // Each further block is as large as all before it, and has 64 slots at least.
        assert_eq!(index_of(&bytes).room.capacity, capacity);
        let ranges = fetched(&bytes).expect("an index").0;
        assert_eq!(ranges, index_of(&bytes));
    }
}

/// Whatever part of the bytes was written before the row was, the take is the old one, and can still grow.
#[test]
fn a_process_that_is_killed_leaves_the_old_take() {
    for spare in [0, 3] {
        let bytes = take_of(&[0.0, 4.0], spare);
        let old = contents(&bytes).expect("its contents");
        let Append { tail, .. } = plan(&bytes, 8.0).expect("room");
        for written in (0..=tail.len()).step_by(13).chain([tail.len()]) {
            let killed = [&bytes[..], &tail[..written]].concat();
            assert_eq!(contents(&killed).expect("the old take"), old);
            let found = contents(&grown(&killed, &[8.0, 10.0])).expect("the new take");
            assert_eq!(found.segments, [0.0, 4.0, 8.0, 10.0].map(segment));
        }
    }
}

/// A row lies within a sector of 512 bytes, so that a disk writes it whole or not at all.
#[test]
fn rows_do_not_cross_sectors() {
    for name in ["", "a", "a name of some length, so that the rows begin elsewhere"] {
        let meta = TakeMeta { name: name.into(), ..meta() };
        let bytes = write_take(&meta, &stream(10, 1), &[], 1).expect("a take");
        for begin in [0.0, 3.0] {
            let bytes = grown(&bytes, &[9.0][..usize::from(begin > 0.0)]);
            assert_eq!(plan(&bytes, begin).expect("room").row_offset % 64, 0);
        }
    }
}

#[test]
fn what_does_not_fit_is_not_appended() {
    let bytes = take_of(&[0.0, 4.0], 1);
    assert!(plan(&bytes, 5.0).expect_err("it overlaps").to_string().contains("only one segment"));
    let full = Limits { segments: 3, ..Limits::large() };
    let index = index_of(&grown(&bytes, &[8.0]));
    let error = Append::plan(&index, 1 << 20, &segment(20.0), &full).expect_err("no slots").to_string();
    assert!(error.contains("slots of the index is 4, at most 3"), "{error}");
}

#[cfg(not(target_os = "unknown"))]
#[test]
fn a_file_grows_and_is_read_by_ranges() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.l4gs");
    let bytes = take_of(&[0.0], 1);
    std::fs::write(&path, &bytes).expect("a file");
    let before = Take::open(&path, &Limits::default()).expect("a take");
    for begin in [6.0, 2.0, 4.0] {
        TakeFile::append(&path, &segment(begin)).expect("room");
    }
    assert!(TakeFile::append(&path, &segment(5.0)).unwrap_err().to_string().contains("a.l4gs"));
    let grown = grown(&bytes, &[6.0, 2.0, 4.0]);
    assert_eq!(std::fs::read(&path).expect("a file"), grown);
    // Who opened it before has the old index; who opens it again, the new one.
    assert_eq!(before.len(), 1);
    assert_eq!(*before.segment(0).expect("a segment").stream, *segment(0.0).stream);
    let take = Take::open(&path, &Limits::default()).expect("a take");
    assert_eq!(take.index(), &index_of(&grown));
    assert_eq!(*take.base().expect("a base"), *stream(10, 1));
    // Only its own range is read: everything else is overwritten.
    for (number, place) in take.index().segments().iter().enumerate() {
        let mut others = vec![0xaa; grown.len()];
        let range = place.range().start as usize..place.range().end as usize;
        others[range.clone()].copy_from_slice(&grown[range]);
        std::fs::write(&path, &others).expect("a file");
        let found = take.segment(number).expect("a segment");
        let expected = segment(2.0 * number as f64);
        assert_eq!((&*found.stream, &found.hidden), (&expected.stream[..], &expected.hidden));
        others[place.offset as usize] ^= 1;
        std::fs::write(&path, &others).expect("a file");
        let error = take.segment(number).expect_err("a checksum").to_string();
        assert!(error.contains("a.l4gs") && error.contains("checksum"), "{error}");
    }
    assert!(matches!(crate::read_file(&path).unwrap_err().kind(), "not-l4gs"));
    std::fs::write(&path, &grown).expect("a file");
    assert!(matches!(crate::read_file(&path).unwrap_err().kind(), "is-take"));
    assert!(TakeFile::append(folder.path(), &segment(5.0)).is_err());
}
