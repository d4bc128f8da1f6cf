//! PNG and JPEG files as images of a frame: `cargo +nightly fuzz run image`, from the folder of `light4gs-data`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use light4gs_data::{Camera, Frame, ImageStore, LoadOptions, Resolution};

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let camera = Camera::look_at([0.0, -1.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 16, 16);
    let options = LoadOptions { resolution: Resolution::Exact { width: 16, height: 16 }, ..LoadOptions::default() };
    for name in ["image.png", "image.jpg"] {
        let path = folder.path().join(name);
        std::fs::write(&path, data).expect("a writable folder");
        let frame = Frame::new("0", camera, 0.0, path, (16, 16));
        let _ = ImageStore::new(&options, 64 << 20).get(&frame);
    }
});
