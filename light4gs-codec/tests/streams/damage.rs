//! Accidental damage is always found, and lengths that are only promised.

use crate::common;

use common::{payload, sample, with_payload};
use light4gs_codec::{CodecError, StreamDecoder, decode, encode, info};

#[test]
fn every_truncation_is_an_error() {
    let bytes = encode(&sample()).unwrap();
    for length in 0..bytes.len() {
        let error = decode(&bytes[..length]).expect_err("cut short");
        assert!(matches!(error, CodecError::Truncated { .. }), "at {length}: {error}");
        assert!(info(&bytes[..length]).is_err());
    }
}

#[test]
fn every_flipped_bit_is_an_error() {
    let mut bytes = encode(&sample()).unwrap();
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(decode(&bytes).is_err(), "bit {bit}");
        assert!(info(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(decode(&bytes).is_ok());
}

#[test]
fn a_damaged_section_is_named() {
    let bytes = encode(&sample()).unwrap();
    for section in info(&bytes).unwrap().sections {
        for at in [section.offset, section.offset + section.bytes - 1] {
            let mut damaged = bytes.clone();
            damaged[at as usize] ^= 0x10;
            let error = decode(&damaged).unwrap_err();
            assert!(matches!(error, CodecError::Checksum { section: name, .. } if name == section.name), "{error}");
        }
    }
    let mut damaged = bytes.clone();
    damaged[40] ^= 1;
    assert!(decode(&damaged).unwrap_err().to_string().starts_with("header: checksum"));
}

#[test]
fn something_appended_is_an_error() {
    let mut bytes = encode(&sample()).unwrap();
    bytes.push(0);
    assert!(matches!(decode(&bytes), Err(CodecError::TrailingBytes { section: "stream", bytes: 1 })));
}

#[test]
fn another_file_is_told_from_a_damaged_one() {
    assert!(matches!(decode(b"ply\nformat ascii 1.0\n"), Err(CodecError::NotL4gs { .. })));
    assert!(matches!(decode(b""), Err(CodecError::Truncated { .. })));
}

#[test]
fn a_section_that_is_longer_than_its_head_says() {
    let long = vec![0; 3 << 20];
    for section in 0..5 {
        let bytes = encode(&sample()).unwrap();
        let bytes = with_payload(&bytes, section, &[payload(&bytes, section), &long].concat());
        let mut decoder = StreamDecoder::new();
        let error = decoder.push(&bytes[..2 << 20]).expect_err("refused before all of it has come");
        for error in [error, decode(&bytes).unwrap_err(), info(&bytes).unwrap_err()] {
            assert!(error.to_string().contains("length of the section is"), "{error}");
        }
    }
}
