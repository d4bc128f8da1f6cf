//! The first bytes of a take.

use super::*;

fn front(bytes: &[u8]) -> Result<Take, CodecError> {
    Take::read_front(bytes.to_vec(), &Limits::default())
}

/// A take whose index has a second block, at its end.
fn grown() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.l4gs");
    std::fs::write(&path, take_of(&[0.0], 0)).unwrap();
    crate::take::TakeFile::append(&path, &segment(2.0)).unwrap();
    std::fs::read(&path).unwrap()
}

#[test]
fn the_base_is_there_as_soon_as_its_bytes_are() {
    for whole in [take_of(&[0.0, 2.0], 3), take_of(&[], 0), grown()] {
        let expected = read(&whole).unwrap();
        let end = expected.index().base().end as usize;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.l4gs");
        for length in 0..=whole.len() {
            let cut = &whole[..length];
            let found = front(cut);
            assert_eq!(found.is_ok(), length >= end, "{length} of {} bytes, the base ends at {end}", whole.len());
            let Ok(found) = found else { continue };
            assert!(found.is_empty() && found.segment_at(1.0).is_none());
            assert_eq!((found.meta(), found.index().base()), (&meta(), expected.index().base()));
            assert!(found.base().unwrap() == expected.base().unwrap(), "another base of {length} bytes");
        }
        for (length, is_enough) in [(end - 1, false), (end, true), (whole.len(), true)] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let found = Take::open_front(&path, &Limits::default());
            assert_eq!(found.is_ok(), is_enough, "{length}");
            match found {
                Ok(found) => assert!(found.base().unwrap() == expected.base().unwrap(), "another base"),
                Err(error) => assert!(error.to_string().contains("cut.l4gs"), "{error}"),
            }
        }
    }
}

#[test]
fn what_is_before_the_base_is_checked_as_in_a_whole_take() {
    let whole = take_of(&[0.0], 2);
    let end = read(&whole).unwrap().index().base().start as usize;
    for at in 0..end {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x10;
        assert!(front(&damaged).is_err(), "byte {at}");
    }
    let reader = IndexReader::new(&Limits::default());
    assert!(!reader.has_front() && reader.finish_front(1 << 20).is_err());
}
