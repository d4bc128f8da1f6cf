//! Deliberate damage in compressed streams: checksums that fit, and false numbers.

mod common;

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
};

use common::{
    ENTRY,
    compression::{ShKind, tiny},
    forge_header, payload, put, table_at, u32_at, with_payload,
};
use light4gs_codec::{
    CodecError, CompressionInput, Limits, Profile, decode, decode_with_limits, encode_compressed, info,
};

/// Counts the memory that is in use.
struct Watch;

static USED: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);
/// Tests that watch the memory run one after the other, each holding this lock.
static ALONE: Mutex<()> = Mutex::new(());

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Watch {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let used = USED.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(used, Ordering::Relaxed);
        // SAFETY: the caller's promise is what the system's allocator requires.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the pointer came from `alloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static WATCH: Watch = Watch;

/// Streams in which every kind of data occurs.
fn streams() -> Vec<Vec<u8>> {
    let mut streams: Vec<_> = [Profile::Compact, Profile::Paper].map(tiny).to_vec();
    let (scene, coupled) = tiny(Profile::Compact);
    let sh = common::compression::sh_networks(ShKind::Everything, 2, 8);
    streams.push((scene, CompressionInput { sh, ..coupled }));
    streams.into_iter().map(|(scene, input)| encode_compressed(&scene, &input).unwrap().bytes).collect()
}

fn sections(bytes: &[u8]) -> usize {
    u32_at(bytes, 12) as usize
}

/// Decodes within 256 MiB; the result does not matter.
fn survive(bytes: &[u8], limits: &Limits) {
    let before = USED.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    let _ = decode_with_limits(bytes, limits);
    let _ = info(bytes);
    let used = MOST.load(Ordering::Relaxed) - before;
    assert!(used < 256 << 20, "{used} bytes");
}

/// Enough for the streams here, so that a false size is refused soon.
fn tight() -> Limits {
    Limits { nanoseconds: 20_000_000, ..Limits::default() }
}

#[test]
fn forging_alone_changes_nothing() {
    for bytes in streams() {
        for section in 0..sections(&bytes) {
            assert_eq!(with_payload(&bytes, section, payload(&bytes, section)), bytes);
        }
    }
}

#[test]
fn every_flipped_bit_without_a_checksum() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for bytes in streams() {
        for section in 0..sections(&bytes) {
            let mut payload = payload(&bytes, section).to_vec();
            // Heads as a whole; beyond them every n-th bit, where n is odd, so that every bit of a byte occurs.
            // `tests/hostile` does the rest.
            let bits = 8 * payload.len();
            for bit in (0..bits.min(512)).chain((512..bits).step_by(11)) {
                payload[bit / 8] ^= 1 << (bit % 8);
                survive(&with_payload(&bytes, section, &payload), &tight());
                payload[bit / 8] ^= 1 << (bit % 8);
            }
        }
    }
}

#[test]
fn heads_that_lie_within_the_default_limits() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for bytes in &streams()[..2] {
        for section in 0..sections(bytes) {
            let mut payload = payload(bytes, section).to_vec();
            for bit in 0..8 * payload.len().min(24) {
                payload[bit / 8] ^= 1 << (bit % 8);
                survive(&with_payload(bytes, section, &payload), &Limits::default());
                payload[bit / 8] ^= 1 << (bit % 8);
            }
        }
    }
}

/// A legal stream just below the default limits, of a shape that needs much padding, and one above.
#[test]
fn the_largest_planes_of_a_small_stream() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let (_, input) = tiny(Profile::Paper);
    let mut scene = common::compression::scene(0, 2, 4, [20_480, 8, 4, 4], &[1, 2]);
    scene.feature_planes.planes.iter_mut().for_each(|plane| plane.values.fill(0.0));
    let planes = input.planes.unwrap();
    let planes = common::compression::plane_coding(&scene.feature_planes, planes.model, planes.steps);
    let bytes =
        encode_compressed(&scene, &CompressionInput { planes: Some(planes), ..tiny(Profile::Paper).1 }).unwrap();
    drop(scene);
    let (demand, limits) = (bytes.verify(&Limits::large()).unwrap(), Limits::default());
    assert!(demand.nanoseconds > limits.nanoseconds / 2 || demand.memory_bytes > limits.memory_bytes / 2, "{demand:?}");
    let bytes = bytes.bytes;
    survive(&bytes, &Limits::default());
    assert!(decode(&bytes).is_ok());

    let bytes = &streams()[1];
    let payload = payload(bytes, 4);
    // Channels, scales; of each scale its planes and x, y, z, t.
    assert_eq!(payload[..12], [4, 2, 63, 8, 4, 4, 4, 63, 16, 8, 8, 4]);
    let varint = |x: u32| [x as u8 | 0x80, (x >> 7) as u8 | 0x80, (x >> 14) as u8];
    let (x, finer) = (varint(29_200), varint(58_400));
    let head = [&payload[..3], &x, &[8], &payload[5..8], &finer, &[16], &payload[10..]].concat();
    let error = decode(&with_payload(bytes, 4, &head)).unwrap_err();
    assert!(matches!(error, CodecError::OverLimit { .. }), "{error}");
}

#[test]
fn every_section_cut_short() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for bytes in streams() {
        for section in 0..sections(&bytes) {
            let payload = payload(&bytes, section);
            for length in (0..payload.len()).step_by(if payload.len() > 1000 { 7 } else { 1 }) {
                survive(&with_payload(&bytes, section, &payload[..length]), &tight());
            }
            // A reader cannot tell where range-coded weights end.
            let longer = [payload, &[1]].concat();
            if let Ok(scene) = decode(&with_payload(&bytes, section, &longer)) {
                assert_eq!(scene, decode(&bytes).unwrap());
            }
        }
    }
}

#[test]
fn every_flip_and_truncation_with_checksums_is_an_error() {
    let bytes = &mut streams()[0];
    for length in 0..bytes.len() {
        assert!(matches!(decode(&bytes[..length]), Err(CodecError::Truncated { .. })));
    }
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(decode(bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

#[test]
fn sections_and_encodings_that_do_not_belong() {
    let bytes = &streams()[0];
    let entry = |section: usize, at: usize, new: u8| {
        let mut bytes = bytes.clone();
        let at = table_at(&bytes) + ENTRY * section + at;
        put(&mut bytes, at, &[new]);
        forge_header(&mut bytes);
        decode(&bytes).unwrap_err()
    };
    for (section, kind) in [(0, 0), (0, 2), (1, 6), (2, 3), (3, 0), (4, 3), (5, 2)] {
        let error = entry(section, 2, kind);
        assert!(matches!(error, CodecError::UnknownKind { .. }), "{section} {kind}: {error}");
    }
    let error = entry(1, 2, 5).to_string();
    assert_eq!(error, "table: kind of the first sh is continued, expected one with a coding of its own");
    for (section, encoding) in [(0, 2), (2, 1), (3, 2), (4, 0), (4, 2), (5, 5)] {
        let error = entry(section, 3, encoding);
        assert!(matches!(error, CodecError::UnknownEncoding { .. }), "{section} {encoding}: {error}");
    }
    // Planes in full precision have no context model, and coded ones need theirs.
    let (scene, input) = tiny(Profile::Compact);
    let plain = encode_compressed(&scene, &CompressionInput { planes: None, ..input }).unwrap().bytes;
    let mut both = with_payload(bytes, 4, payload(&plain, 4));
    let at = table_at(&both) + 4 * ENTRY + 2;
    put(&mut both, at, &[1, 0]);
    forge_header(&mut both);
    assert!(decode(&both).unwrap_err().to_string().contains("no plane is coded with it"));
    let mut none = with_payload(&plain, 4, payload(bytes, 4));
    put(&mut none, at, &[2, 1]);
    forge_header(&mut none);
    assert!(matches!(decode(&none), Err(CodecError::MissingSection { section: "context_model" })));
}

#[test]
fn values_that_take_no_bytes_are_limited() {
    let (scene, input) = tiny(Profile::Paper);
    let bytes = encode_compressed(&scene, &input).unwrap().bytes;
    // Each byte may take four bytes and 400 nanoseconds, so limits of zero refuse only streams that need more.
    let (scene, input) = tiny(Profile::Compact);
    let dense = encode_compressed(&scene, &input).unwrap().bytes;
    let error = decode_with_limits(&dense, &Limits { memory_bytes: 0, ..Limits::default() }).unwrap_err();
    assert!(error.to_string().contains("memory that decoding takes in bytes is"), "{error}");
    assert!(error.to_string().contains("--limits large"), "{error}");
    let mut planes = common::compression::scene(0, 2, 4, [64, 64, 64, 4], &[1, 2]);
    planes.feature_planes.planes.iter_mut().for_each(|plane| plane.values.fill(0.0));
    let coding = common::compression::input(
        &planes,
        Profile::Compact,
        common::compression::compact_shape(4, Default::default()),
    );
    let thin = encode_compressed(&planes, &coding).unwrap().bytes;
    let error = decode_with_limits(&thin, &Limits { nanoseconds: 0, ..Limits::default() }).unwrap_err();
    assert!(error.to_string().contains("time that decoding takes in nanoseconds is"), "{error}");
    let limits = Limits { layer_weights: 100, ..Limits::default() };
    let error = decode_with_limits(&bytes, &limits).unwrap_err();
    assert!(matches!(error, CodecError::OverLimit { section: "context_model", .. }), "{error}");
}
