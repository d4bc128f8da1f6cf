//! Damage on purpose: checksums that fit, and counts that would fill the memory.

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicUsize, Ordering},
};

use common::{ENTRY, forge_header, forge_section, put, sample, table_at, u64_at};
use light4gs_codec::{CodecError, Limits, decode, decode_with_limits, encode, info};

/// Remembers the largest piece of memory that anybody asked for.
struct Watch;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it came.
unsafe impl GlobalAlloc for Watch {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static WATCH: Watch = Watch;

/// Both ways in refuse `bytes`, and nobody asks for much memory. Returns what `decode` says.
fn refuse(bytes: &[u8]) -> CodecError {
    let error = decode(bytes).expect_err("hostile");
    let _ = info(bytes);
    let largest = LARGEST.load(Ordering::Relaxed);
    assert!(largest < 1 << 20, "somebody asked for {largest} bytes");
    error
}

fn start(bytes: &[u8], section: usize) -> usize {
    u64_at(bytes, table_at(bytes) + ENTRY * section + 8) as usize
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
    let error = forged_prelude(8, &3u16.to_le_bytes());
    assert!(matches!(error, CodecError::NewerVersion { found: 3 }));
    assert!(error.to_string().contains("version 3"));
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
    assert!(matches!(forged_prelude(20, &(1u64 << 37).to_le_bytes()), CodecError::Truncated { .. }));
    assert!(matches!(forged_prelude(20, &0u64.to_le_bytes()), CodecError::TrailingBytes { .. }));
}

#[test]
fn a_table_that_lies() {
    let bytes = encode(&sample()).unwrap();
    let range = |section, at, value: u64| {
        let error = forged_entry(section, at, &value.to_le_bytes());
        assert!(matches!(error, CodecError::SectionRange { .. }), "{error}");
        error.to_string()
    };
    let second = start(&bytes, 1) as u64;
    assert!(range(1, 8, second - 1).contains("overlap the section before"));
    assert!(range(1, 8, second + 1).contains("gap"));
    assert!(range(0, 8, 0).contains("overlap the header"));
    assert!(range(2, 8, u64::MAX).contains("beyond the end"));
    assert!(range(4, 8, bytes.len() as u64 + 1).contains("beyond the end"));
    assert!(range(4, 16, u64::MAX).contains("beyond the end"));
    let last = u64_at(&bytes, table_at(&bytes) + ENTRY * 4 + 16);
    assert!(matches!(forged_entry(4, 16, &(last - 1).to_le_bytes()), CodecError::TrailingBytes { .. }));

    let error = forged_entry(3, 0, &99u16.to_le_bytes());
    assert!(matches!(error, CodecError::UnknownSection { index: 3, id: 99 }));
    assert!(matches!(forged_entry(3, 0, &1u16.to_le_bytes()), CodecError::DuplicateSection { section: "gaussians" }));
    let error = forged_entry(4, 2, &7u16.to_le_bytes());
    assert!(matches!(error, CodecError::UnknownEncoding { section: "hexplanes", encoding: 7 }));
}

#[test]
fn a_missing_section() {
    // The last entry of the table becomes a part of no section, and its section goes.
    let bytes = encode(&sample()).unwrap();
    let (table, cut) = (table_at(&bytes), start(&bytes, 4));
    let mut shorter = bytes[..table + 4 * ENTRY].to_vec();
    shorter.extend(&bytes[table + 5 * ENTRY..cut]);
    put(&mut shorter, 12, &4u32.to_le_bytes());
    let length = shorter.len() as u64;
    put(&mut shorter, 20, &length.to_le_bytes());
    for section in 0..4 {
        let offset = start(&bytes, section) as u64 - ENTRY as u64;
        put(&mut shorter, table + section * ENTRY + 8, &offset.to_le_bytes());
    }
    forge_header(&mut shorter);
    assert!(matches!(refuse(&shorter), CodecError::MissingSection { section: "hexplanes" }));
}

#[test]
fn huge_counts_in_sections() {
    let over = |section, at| {
        let error = forged(section, at, &u32::MAX.to_le_bytes());
        assert!(matches!(error, CodecError::OverLimit { .. }), "{error}");
    };
    over(0, 0); // Gaussians
    over(1, 0);
    over(3, 0); // width, depth, layers, length of a name
    over(3, 4);
    over(3, 9);
    over(3, 13);
    for at in [0, 4, 8, 12, 16, 20] {
        over(4, at); // channels, resolution, scales
    }
    // The most that the limits allow is not there either.
    for (section, at, count) in [(0, 0, 1 << 26), (1, 0, 1 << 26), (3, 9, 1 << 10), (4, 0, 1 << 12), (4, 20, 16)] {
        let error = forged(section, at, &u32::to_le_bytes(count));
        assert!(matches!(error, CodecError::Truncated { .. }), "{error}");
    }
}

#[test]
fn contradictions_in_sections() {
    let fewer = forged(0, 0, &1u32.to_le_bytes());
    assert!(matches!(fewer, CodecError::TrailingBytes { section: "gaussians", .. }));
    assert!(forged(1, 4, &[4]).to_string().contains("degree is 4"));
    assert!(forged(3, 8, &[0b10_0000]).to_string().contains("heads"));
    assert!(forged(3, 17, &[0xff]).to_string().contains("UTF-8"));
    assert!(forged(4, 0, &0u32.to_le_bytes()).to_string().contains("channels"));
    let plane = 24 + 2 * 4;
    assert!(forged(4, plane, &9u32.to_le_bytes()).to_string().contains("planes[0].height is 9"));
    assert!(forged(4, plane, &0u32.to_le_bytes()).to_string().contains("planes[0].height is 0"));
    let nan = f32::NAN.to_le_bytes();
    assert!(forged(0, 4, &nan).to_string().contains("value 0 of means is NaN"));
    assert!(forged(2, 4, &nan).to_string().contains("value 1 of mean is NaN"));
}

#[test]
fn a_section_with_another_number_of_gaussians() {
    let mut scene = sample();
    scene.gaussians = common::gaussians(2, 0);
    let mut bytes = encode(&scene).unwrap();
    let at = start(&bytes, 1);
    put(&mut bytes, at, &3u32.to_le_bytes());
    forge_section(&mut bytes, 1);
    assert_eq!(refuse(&bytes).to_string(), "sh: count is 3, expected 2, the number of Gaussians");
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

#[test]
fn limits_of_the_caller() {
    let bytes = encode(&sample()).unwrap();
    let limits = Limits { gaussians: 1, ..Limits::default() };
    let error = decode_with_limits(&bytes, &limits).unwrap_err();
    assert!(matches!(error, CodecError::OverLimit { found: 2, limit: 1, .. }));
    let limits = Limits { file_bytes: 100, ..Limits::default() };
    assert!(decode_with_limits(&bytes, &limits).is_err());
}
