//! Times the parts of the codec on a scene of the paper's size:
//! `cargo run -p light4gs-codec --release --example speed [threads]`.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::Instant;

use common::compression::{ALL_PARTS, compact_shape, input, reference_shape, scene};
use light4gs_codec::{HexPlaneArrays, OpenStream, Profile, encode_compressed};

fn timed<T>(name: &str, symbols: usize, work: impl Fn() -> T) -> T {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..3 {
        let start = Instant::now();
        result = Some(work());
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("  {name:<12} {:8.1} ms {:8.2} Msymbols/s", 1e3 * best, symbols as f64 / best / 1e6);
    result.unwrap()
}

fn main() {
    if let Some(threads) = std::env::args().nth(1) {
        rayon::ThreadPoolBuilder::new().num_threads(threads.parse().unwrap()).build_global().unwrap();
    }
    let scene = scene(12_000, 3, 32, [64, 64, 64, 24], &[1, 2]);
    let planes: usize = scene.hexplane.planes.iter().map(|plane| plane.values.len()).sum();
    let sh = scene.gaussians.sh_rest.len();
    println!("{planes} plane values, {sh} harmonics, {} threads", rayon::current_num_threads());
    for (name, shape) in [("compact", compact_shape(32, ALL_PARTS)), ("reference", reference_shape(32, ALL_PARTS))] {
        let input = input(&scene, Profile::Compact, shape);
        println!("{name} context model");
        let encoded = timed("encode", planes + sh, || encode_compressed(&scene, &input).unwrap());
        let stream = OpenStream::new(&encoded.bytes).unwrap();
        let frame = stream.frame().unwrap();
        timed("decode", planes + sh, || stream.scene().unwrap());
        timed("planes", planes, || stream.hexplanes().unwrap());
        let gaussians = timed("attributes", 0, || stream.gaussians().unwrap());
        timed("sh", sh, || stream.sh(gaussians.clone(), &frame, &HexPlaneArrays::default()).unwrap());
        println!("  {} bytes: {:?}", encoded.bytes.len(), encoded.report.sections);
    }
}
