//! PLY files of Gaussians and of points: `cargo +nightly fuzz run ply`, from the folder of `light4gs-data`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use light4gs_data::{GaussianPly, PointCloud};

fuzz_target!(|data: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("points.ply");
    std::fs::write(&path, data).expect("a writable folder");
    let _ = GaussianPly::read(&path);
    let _ = PointCloud::read_ply(&path);
});
