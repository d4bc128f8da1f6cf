//! Valid streams, from which the hostile ones are made.

use light4gs_codec::{
    CompressionInput, FrequencyTable, GaussianLayers, Profile, ShCoding, encode, encode_compressed, info,
};

use crate::parts::Parts;

#[path = "../../../../light4gs-codec/tests/common/mod.rs"]
mod common;

use common::compression::{ALL_PARTS, ShKind, compact_shape, input, scene, sh_networks, tiny};

/// The golden streams with control nodes, by name: only a model can make such.
fn nodes() -> Vec<Vec<u8>> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../golden-streams");
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).expect("a folder").map(|file| file.expect("a file").path()).collect();
    paths.retain(|path| path.to_str().is_some_and(|path| path.ends_with(".l4gs") && !path.ends_with(".decoded.l4gs")));
    paths.sort();
    let mut streams: Vec<_> = paths.iter().map(|path| std::fs::read(path).expect("a file")).collect();
    streams.retain(|bytes| info(bytes).expect("sound").motion.kind == "nodes");
    streams
}

/// Streams that together contain everything: without loss, in both profiles, with every model of the spherical
/// harmonics, with control nodes and all that Gaussians learn for them, with many Gaussians, with long frequency tables.
pub(crate) fn streams() -> Vec<Parts> {
    let mut streams = vec![encode(&common::sample()).expect("sound")];
    streams.extend(nodes());
    let mut add = |scene: &_, input: &_| streams.push(encode_compressed(scene, input).expect("sound").bytes);
    for profile in [Profile::Compact, Profile::Paper] {
        let (scene, input) = tiny(profile);
        add(&scene, &input);
        add(&scene, &CompressionInput { sh: sh_networks(ShKind::Everything, 2, 8), ..input.clone() });
        add(&scene, &CompressionInput { sh: ShCoding::Channels { step: 0.02 }, ..input.clone() });
        add(&scene, &CompressionInput { planes: None, ..input });
    }
    let many = scene(400, 3, 4, [8, 8, 8, 4], &[1]);
    let coding = input(&many, Profile::Compact, compact_shape(4, ALL_PARTS));
    add(&many, &coding);
    let flat = vec![1.0 / 16_384.0; 16_384];
    let table = FrequencyTable::from_pmf(-8192, &flat).expect("a legal table");
    add(&many, &CompressionInput { sh: ShCoding::Tables { step: 0.02, tables: vec![table; 45] }, ..coding });
    streams.extend(layered());
    streams.iter().map(|bytes| Parts::of(bytes)).collect()
}

/// Streams of several layers of Gaussians: in both profiles, with every model of the spherical harmonics.
fn layered() -> Vec<Vec<u8>> {
    let mut streams = Vec::new();
    for profile in [Profile::Compact, Profile::Paper] {
        let scene = scene(40, 2, 4, [8, 4, 4, 4], &[1, 2]);
        let input = input(&scene, profile, compact_shape(4, ALL_PARTS));
        let codings = [
            sh_networks(ShKind::Everything, 2, 8),
            input.sh.clone(),
            ShCoding::Channels { step: 0.02 },
            ShCoding::Channels { step: 0.02 },
        ];
        for (sh, count) in codings.into_iter().zip([2, 3, 4, 8]) {
            let layers = GaussianLayers::new(count);
            // Without planes there is little but layers.
            let planes = input.planes.clone().filter(|_| count < 8);
            let input = CompressionInput { sh, layers, planes, ..input.clone() };
            streams.push(encode_compressed(&scene, &input).expect("sound").bytes);
        }
    }
    streams
}
