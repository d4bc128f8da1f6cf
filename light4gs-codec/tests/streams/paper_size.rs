//! Scenes of the paper's size stay within the default limits.

use crate::common;

use common::compression::{ALL_PARTS, ShKind, compact_shape, input, reference_shape, scene, sh_networks};
use light4gs_codec::{CompressionInput, Limits, Profile, decode, encode_compressed};

/// The hexplane of the paper: 64 cells at two scales, 32 channels.
#[test]
fn the_papers_planes_under_either_architecture() {
    let scene = scene(12_000, 3, 32, [64, 64, 64, 24], &[1, 2]);
    let features = 64;
    for (name, shape) in [("compact", compact_shape(32, ALL_PARTS)), ("reference", reference_shape(32, ALL_PARTS))] {
        let tables = input(&scene, Profile::Compact, shape);
        let coupled = CompressionInput { sh: sh_networks(ShKind::Everything, 3, features), ..tables.clone() };
        for (sh, input) in [("tables", tables), ("networks", coupled)] {
            let encoded = encode_compressed(&scene, &input).unwrap();
            let (demand, limits) = (encoded.verify(&Limits::large()).unwrap(), Limits::default());
            println!("{name}, {sh}: {} bytes, {demand:?}", encoded.bytes.len());
            if let Ok(folder) = std::env::var("LIGHT4GS_STREAMS") {
                std::fs::write(format!("{folder}/{name}-{sh}.l4gs"), &encoded.bytes).unwrap();
            }
            assert!(demand.nanoseconds < limits.nanoseconds && demand.memory_bytes < limits.memory_bytes, "{demand:?}");
            assert!(decode(&encoded.bytes).is_ok());
        }
    }
}
