//! Accidental damage is always found.

use crate::common;

use common::sample;
use light4gs_codec::{CodecError, decode, encode, info};

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
