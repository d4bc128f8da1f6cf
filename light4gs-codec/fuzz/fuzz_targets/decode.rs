//! The decoder on bytes whose checksums fit.
//!
//! Datasets, point clouds and images have targets in `light4gs-data/fuzz`. Checkpoints (safetensors) and configurations
//! (TOML) have none: their readers are in a crate that depends on Burn, which would be built a second time with
//! libFuzzer's flags. Instead, seeded tests of that crate damage thousands of both.
//!
//! Start from the golden streams, from the folder of `light4gs-codec` and with a nightly compiler:
//! `cargo +nightly fuzz run decode fuzz/corpus/decode ../tests/golden-streams`

#![no_main]

use libfuzzer_sys::fuzz_target;
use light4gs_codec::{Limits, decode_with_limits, encode, info};

const PRELUDE: usize = 32;
const ENTRY: usize = 16;

/// Small enough that a false size is refused soon.
const LIMITS: Limits = Limits {
    file_bytes: 1 << 20,
    meta_bytes: 1 << 12,
    sections: 8,
    string_bytes: 1 << 8,
    name_bytes: 1 << 6,
    extras: 8,
    frames: 1 << 10,
    image_side: 1 << 12,
    image_pixels: 1 << 22,
    segments: 1 << 8,
    gaussians: 1 << 12,
    attributes: 8,
    attribute_width: 16,
    channels: 64,
    resolution: 1 << 8,
    scales: 4,
    networks: 8,
    nodes: 32,
    layer_width: 1 << 10,
    layer_weights: 1 << 16,
    memory_bytes: 32 << 20,
    nanoseconds: 50_000_000,
};

fuzz_target!(|data: &[u8]| {
    let _ = decode_with_limits(data, &LIMITS);
    let mut bytes = data.to_vec();
    if forge(&mut bytes).is_some() {
        let _ = info(&bytes);
        if let Ok(scene) = decode_with_limits(&bytes, &LIMITS) {
            encode(&scene).expect("what is decoded can be encoded");
        }
    }
});

/// Makes the length of the stream, the lengths of the sections and the checksums fit, if there is a table at all.
fn forge(bytes: &mut [u8]) -> Option<()> {
    let length = bytes.len() as u64;
    bytes.get_mut(20..28)?.copy_from_slice(&length.to_le_bytes());
    let number = |bytes: &[u8], at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize);
    let (sections, meta) = (number(bytes, 12)?, number(bytes, 16)?);
    let table = PRELUDE.checked_add(meta)?;
    let end = sections.checked_mul(ENTRY)?.checked_add(table).filter(|&end| end <= bytes.len())?;
    let mut start = end;
    for section in 0..sections {
        let entry = table + section * ENTRY;
        let left = bytes.len() - start;
        let stated = u64::from_le_bytes(*bytes.get(entry + 8..)?.first_chunk()?);
        // The last section gets all remaining bytes.
        let size = if section + 1 == sections { left } else { left.min(stated.try_into().unwrap_or(left)) };
        let crc = crc32c::crc32c(&bytes[start..start + size]);
        bytes[entry + 4..entry + 8].copy_from_slice(&crc.to_le_bytes());
        bytes[entry + 8..entry + 16].copy_from_slice(&(size as u64).to_le_bytes());
        start += size;
    }
    let crc = crc32c::crc32c_append(crc32c::crc32c(&bytes[..28]), &bytes[PRELUDE..end]);
    bytes[28..32].copy_from_slice(&crc.to_le_bytes());
    Some(())
}
