//! The JSON of a D-NeRF dataset: `cargo +nightly fuzz run transforms`, from the folder of `light4gs-data`.

#![no_main]

use std::{fs, path::Path};

use libfuzzer_sys::fuzz_target;
use light4gs_data::{LoadOptions, Scene};

/// An image of one pixel, for the frames of a dataset that is nearly sound.
const PIXEL: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x06\0\0\0\x1f\x15\xc4\x89\0\0\0\rIDATx\x9cc\
    \xf8\xcf\xc0\xf0\x1f\0\x05\0\x01\xff\x89\x99=\x1d\0\0\0\0IEND\xaeB`\x82";

fn open(folder: &Path, json: &[u8]) -> std::io::Result<()> {
    for split in ["train", "test"] {
        fs::write(folder.join(format!("transforms_{split}.json")), json)?;
        fs::create_dir_all(folder.join(split))?;
        fs::write(folder.join(split).join("r_000.png"), PIXEL)?;
    }
    let _ = Scene::open(folder, &LoadOptions { random_points: 4, ..LoadOptions::default() });
    Ok(())
}

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    open(folder.path(), data).expect("a writable folder");
});
