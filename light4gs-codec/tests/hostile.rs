//! Deliberate damage: checksums that fit, and counts that would fill the memory.

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicUsize, Ordering},
};

use common::{ENTRY, forge_header, forge_section, payload, put, sample, start, table_at, u64_at, with_payload};
use light4gs_codec::{CodecError, Limits, StreamDecoder, decode, decode_with_limits, encode, info};

/// Remembers the largest allocation.
struct Watch;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Watch {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise is what the system's allocator requires.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static WATCH: Watch = Watch;

/// `decode` and `info` refuse `bytes` without a large allocation. Returns the error of `decode`.
fn refuse(bytes: &[u8]) -> CodecError {
    let error = decode(bytes).expect_err("hostile");
    let _ = info(bytes);
    let largest = LARGEST.load(Ordering::Relaxed);
    assert!(largest < 1 << 20, "somebody asked for {largest} bytes");
    error
}

/// The sample with `new` at `at` in a section, checksums forged.
fn forged(section: usize, at: usize, new: &[u8]) -> CodecError {
    let mut bytes = encode(&sample()).unwrap();
    let at = start(&bytes, section) + at;
    put(&mut bytes, at, new);
    forge_section(&mut bytes, section);
    refuse(&bytes)
}

/// The sample with `new` at `at` in the table entry of a section, checksum forged.
fn forged_entry(section: usize, at: usize, new: &[u8]) -> CodecError {
    let mut bytes = encode(&sample()).unwrap();
    let at = table_at(&bytes) + ENTRY * section + at;
    put(&mut bytes, at, new);
    forge_header(&mut bytes);
    refuse(&bytes)
}

/// The sample with `new` at `at` in the prelude, checksum forged.
fn forged_prelude(at: usize, new: &[u8]) -> CodecError {
    let mut bytes = encode(&sample()).unwrap();
    put(&mut bytes, at, new);
    if at != 12 && at != 16 {
        forge_header(&mut bytes);
    }
    refuse(&bytes)
}

#[test]
fn forging_alone_changes_nothing() {
    let mut bytes = encode(&sample()).unwrap();
    let before = bytes.clone();
    (0..5).for_each(|section| forge_section(&mut bytes, section));
    assert_eq!(bytes, before);
}

#[test]
fn versions_and_flags() {
    let error = forged_prelude(8, &2u16.to_le_bytes());
    assert!(matches!(error, CodecError::NewerVersion { found: 2 }));
    assert!(error.to_string().contains("version 2"));
    assert!(matches!(forged_prelude(8, &0u16.to_le_bytes()), CodecError::Invalid { .. }));
    assert!(forged_prelude(10, &[1, 0]).to_string().contains("flags"));
}

#[test]
fn huge_numbers_in_the_prelude() {
    let huge = u32::MAX.to_le_bytes();
    assert!(matches!(forged_prelude(12, &huge), CodecError::OverLimit { .. }));
    assert!(matches!(forged_prelude(12, &64u32.to_le_bytes()), CodecError::Truncated { .. }));
    assert!(matches!(forged_prelude(16, &huge), CodecError::OverLimit { .. }));
    assert!(matches!(forged_prelude(16, &(1u32 << 20).to_le_bytes()), CodecError::Truncated { .. }));
    assert!(matches!(forged_prelude(20, &u64::MAX.to_le_bytes()), CodecError::OverLimit { .. }));
    assert!(matches!(forged_prelude(20, &(1u64 << 36).to_le_bytes()), CodecError::OverLimit { .. }));
    assert!(matches!(forged_prelude(20, &(1u64 << 29).to_le_bytes()), CodecError::Truncated { .. }));
    assert!(matches!(forged_prelude(20, &0u64.to_le_bytes()), CodecError::TrailingBytes { .. }));
}

#[test]
fn a_table_that_lies() {
    let bytes = encode(&sample()).unwrap();
    let length = |section: usize| u64_at(&bytes, table_at(&bytes) + ENTRY * section + 8);
    let lied = |section, value: u64| forged_entry(section, 8, &value.to_le_bytes());
    // Too long: the last section is cut short. Too short: bytes are left at the end, or the bytes are those of the next
    // section.
    assert!(matches!(lied(0, length(0) + 1), CodecError::Truncated { section: "feature_planes", .. }));
    assert!(matches!(lied(2, u64::MAX), CodecError::Truncated { section: "scene_coordinates", .. }));
    assert!(matches!(lied(4, length(4) + 1), CodecError::Truncated { section: "feature_planes", .. }));
    assert!(matches!(lied(4, length(4) - 1), CodecError::TrailingBytes { section: "stream", bytes: 1 }));
    assert!(matches!(lied(1, length(1) - 1), CodecError::TrailingBytes { section: "stream", bytes: 1 }));

    let error = forged_entry(3, 0, &99u16.to_le_bytes());
    assert!(matches!(error, CodecError::UnknownSection { index: 3, id: 99 }));
    assert!(matches!(forged_entry(4, 0, &4u16.to_le_bytes()), CodecError::DuplicateSection { section: "motion" }));
    let error = forged_entry(3, 0, &1u16.to_le_bytes());
    assert_eq!(error.to_string(), "table: number of sh sections is 1, expected 2, one for each gaussians section");
    let error = forged_entry(4, 2, &[7]);
    assert_eq!(error.to_string(), "feature_planes: unknown kind 7; use a newer program");
    let error = forged_entry(4, 3, &[7]);
    assert_eq!(error.to_string(), "feature_planes: unknown encoding 7 of the kind \"explicit\"; use a newer program");
}

#[test]
fn a_missing_section() {
    // The last entry of the table is removed, and its section with it.
    let bytes = encode(&sample()).unwrap();
    let (table, cut) = (table_at(&bytes), start(&bytes, 4));
    let mut shorter = bytes[..table + 4 * ENTRY].to_vec();
    shorter.extend(&bytes[table + 5 * ENTRY..cut]);
    put(&mut shorter, 12, &4u32.to_le_bytes());
    let length = shorter.len() as u64;
    put(&mut shorter, 20, &length.to_le_bytes());
    forge_header(&mut shorter);
    assert!(matches!(refuse(&shorter), CodecError::MissingSection { section: "feature_planes" }));
}

/// The sample with the first bytes of a section replaced, whatever their number.
fn replaced(section: usize, count: usize, new: &[u8]) -> CodecError {
    let bytes = encode(&sample()).unwrap();
    let payload = payload(&bytes, section);
    refuse(&with_payload(&bytes, section, &[new, &payload[count..]].concat()))
}

/// 2^32 - 1 as a varint.
const HUGE: [u8; 5] = [0xff, 0xff, 0xff, 0xff, 0x0f];

#[test]
fn huge_counts_in_sections() {
    let over = |error: CodecError| assert!(matches!(error, CodecError::OverLimit { .. }), "{error}");
    over(forged(0, 0, &u32::MAX.to_le_bytes())); // Gaussians
    over(replaced(1, 1, &HUGE));
    over(replaced(3, 1, &HUGE)); // length of the kind
    let bytes = encode(&sample()).unwrap();
    // Motion: kind, presence of a network, 2 inputs of 2 and 1 channels, 5 nodes.
    let head = &payload(&bytes, 3)[..16];
    assert_eq!(head, b"\x0atest-field\x01\x02\x02\x01\x05");
    for at in 12..16 {
        over(replaced(3, at + 1, &[&head[..at], &HUGE].concat()));
    }
    // Planes: channels, 2 scales, which planes there are, cells along x, y, z, t.
    assert_eq!(payload(&bytes, 4)[..12], [1, 2, 0b11_1111, 2, 1, 1, 3, 0b11_1111, 4, 2, 2, 3]);
    for at in [0, 1, 3, 4, 5, 6, 8] {
        over(replaced(4, at + 1, &[&payload(&bytes, 4)[..at], &HUGE].concat()));
    }
    // Counts just at the limits are refused too, since the bytes are missing.
    let cut = |error: CodecError| assert!(matches!(error, CodecError::Truncated { .. }), "{error}");
    cut(forged(0, 0, &(1u32 << 26).to_le_bytes()));
    cut(replaced(4, 1, &[0x80, 0x20])); // 2^12 channels
}

#[test]
fn contradictions_in_sections() {
    let fewer = forged(0, 0, &1u32.to_le_bytes());
    assert!(matches!(fewer, CodecError::TrailingBytes { section: "gaussians", .. }));
    assert!(forged(1, 1, &[4]).to_string().contains("degree is 4"));
    assert!(forged(3, 1, &[0xff]).to_string().contains("UTF-8"));
    assert!(forged(3, 1, b"T").to_string().contains("kind is"));
    assert!(forged(3, 11, &[2]).to_string().contains("presence of a network is 2"));
    assert!(forged(3, 16, &[77]).to_string().contains("operation of the network, node 0 is 77"));
    assert!(forged(4, 0, &[0]).to_string().contains("channels"));
    assert!(forged(4, 3, &[0]).to_string().contains("width of plane 0.xy is 0"));
    let nan = f32::NAN.to_le_bytes();
    // After the count and the list of attributes.
    assert!(forged(0, 65, &nan).to_string().contains("value 0 of means is NaN"));
    assert!(forged(2, 4, &nan).to_string().contains("value 1 of mean is NaN"));
}

#[test]
fn a_section_with_another_number_of_gaussians() {
    assert_eq!(forged(1, 0, &[3]).to_string(), "sh: count is 3, expected 2, the number of Gaussians");
}

#[test]
fn a_meta_that_lies() {
    let name = sample().meta.name.len();
    let extra = 32 + 4 + name + 4 + 4 + 36 + 32 + 8 + 4;
    let huge = u32::MAX.to_le_bytes();
    assert!(matches!(forged_prelude(32, &huge), CodecError::OverLimit { section: "meta", .. }));
    assert!(matches!(forged_prelude(32, &60_000u32.to_le_bytes()), CodecError::Truncated { section: "meta", .. }));
    assert!(matches!(forged_prelude(extra, &huge), CodecError::OverLimit { section: "meta", .. }));
    assert!(matches!(forged_prelude(extra, &1u32.to_le_bytes()), CodecError::TrailingBytes { section: "meta", .. }));
    // "author" becomes "xuthor", which comes after "writer".
    assert!(forged_prelude(extra + 8, b"x").to_string().contains("rising keys"));
}

/// Every reader refuses them: one that decodes, one that does not, and one whose bytes are still coming.
#[test]
fn numbers_of_the_meta_that_are_not_finite() {
    let fps = 32 + 4 + sample().meta.name.len() + 4;
    let fov = fps + 4 + 24 + 12 + 32 + 8;
    for (at, field) in [(fps, "fps"), (fps + 4 + 8, "bounds"), (fps + 28 + 4, "background"), (fov, "fov_x")] {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut bytes = encode(&sample()).unwrap();
            put(&mut bytes, at, &bad.to_le_bytes());
            forge_header(&mut bytes);
            let coming = StreamDecoder::new().push(&bytes).unwrap_err();
            for error in [decode(&bytes).unwrap_err(), info(&bytes).unwrap_err(), coming] {
                assert!(
                    matches!(&error, CodecError::NonFinite { section: "meta", field: found, .. } if found == field),
                    "{error}"
                );
            }
        }
    }
}

/// What stands in the heads and in the small sections is looked at without decoding.
#[test]
fn a_description_refuses_what_a_decoder_refuses() {
    let mut bytes = encode(&sample()).unwrap();
    let at = start(&bytes, 2) + 4;
    put(&mut bytes, at, &f32::NAN.to_le_bytes());
    forge_section(&mut bytes, 2);
    assert!(info(&bytes).unwrap_err().to_string().starts_with("scene_coordinates: value 1 of mean is NaN"));
}

#[test]
fn limits_of_the_caller() {
    let bytes = encode(&sample()).unwrap();
    let limits = Limits { gaussians: 1, ..Limits::default() };
    let error = decode_with_limits(&bytes, &limits).unwrap_err();
    assert!(matches!(error, CodecError::OverLimit { found: 2, limit: 1, .. }));
    let limits = Limits { file_bytes: 100, ..Limits::default() };
    assert!(decode_with_limits(&bytes, &limits).is_err());
}
