//! A small scene in which every kind of data occurs.

#![allow(dead_code, unreachable_pub)] // each test binary uses its part

pub mod compression;

use light4gs_codec::{
    CoordinateMapping, FeaturePlaneArrays, FurtherAttribute, GaussianArrays, MotionArrays, MotionNetwork, MotionOutput,
    MotionSource, NamedTensor, Network, SceneCoordinateArrays, SceneData, SceneMeta,
    network::{Layer, Operation},
    plane_layout::{PlaneAxes, PlaneLayout},
    sh_rest_coefficients,
};

/// Numbers that all differ, are exact in float32 and depend only on their position.
pub fn numbers(count: usize) -> Vec<f32> {
    (0..count).map(|i| (i as f32 - 3.0) / 8.0).collect()
}

/// `count` groups of numbers.
pub fn groups<const K: usize>(count: usize) -> Vec<[f32; K]> {
    numbers(K * count).as_chunks().0.to_vec()
}

/// Gaussians with all arrays filled.
pub fn gaussians(count: usize, sh_degree: u8) -> GaussianArrays {
    GaussianArrays {
        means: groups(count),
        log_scales: groups(count),
        quats: groups(count),
        opacity_logits: numbers(count),
        sh_dc: groups(count),
        sh_degree,
        sh_rest: numbers(count * sh_rest_coefficients(sh_degree) * 3),
        further: Vec::new(),
    }
}

/// The checksum of a frame: all attributes in the order of [`GaussianArrays::attributes`], bit by bit.
pub fn frame_checksum(moved: &GaussianArrays) -> u32 {
    let numbers = moved.attributes().flat_map(|attribute| attribute.values);
    let bytes: Vec<u8> = numbers.flat_map(|number| number.to_bits().to_le_bytes()).collect();
    crc32c::crc32c(&bytes)
}

/// An optional further attribute.
pub fn further(name: &str, width: usize, count: usize) -> FurtherAttribute {
    FurtherAttribute { name: name.into(), width: width as u32, values: numbers(width * count), optional: true }
}

/// Planes over these axes whose time axis is not multiplied.
pub fn planes(axes: &[PlaneAxes], channels: u32, resolution: [u32; 4], multipliers: &[u32]) -> FeaturePlaneArrays {
    let multipliers: Vec<usize> = multipliers.iter().map(|&multiplier| multiplier as usize).collect();
    let layout = PlaneLayout::multiscale(axes, resolution.map(|cells| cells as usize), &multipliers);
    let mut planes = FeaturePlaneArrays::without_values(channels, &layout);
    for plane in &mut planes.planes {
        plane.values = numbers((channels * plane.height * plane.width) as usize);
    }
    planes
}

/// A hexplane whose time axis is not multiplied.
pub fn hexplane(channels: u32, resolution: [u32; 4], multipliers: &[u32]) -> FeaturePlaneArrays {
    planes(&PlaneAxes::ALL, channels, resolution, multipliers)
}

/// A layer from `inputs` to `outputs` channels.
pub fn linear(inputs: usize, outputs: usize) -> Layer {
    Layer::linear(numbers(inputs * outputs), numbers(outputs))
}

/// A network that moves positions and rotations, and a tensor of no known use.
pub fn motion(features: u32) -> MotionArrays {
    let (mut network, inputs) = Network::new([features, 1]);
    let known = network.node(Operation::Concatenate, &inputs);
    let hidden = network.layer(known, linear(features as usize + 1, 3));
    let hidden = network.relu(hidden);
    let position = network.layer(hidden, linear(3, 3));
    let rotation = network.layer(hidden, linear(3, 4));
    network.outputs = vec![position, rotation];
    let sources = vec![MotionSource::Features, MotionSource::Time];
    let outputs = vec![MotionOutput::Position, MotionOutput::Quaternion];
    let tensors = vec![NamedTensor { name: "nodes".into(), shape: vec![2, 3], values: numbers(6) }];
    MotionArrays { kind: "test-field".into(), network: Some(MotionNetwork { network, sources, outputs }), tensors }
}

/// The scene.
pub fn sample() -> SceneData {
    SceneData {
        meta: SceneMeta {
            name: "tiny \u{1f3be}".into(),
            frame_count: 7,
            fps: 29.5,
            bounds: [[-1.0, -2.0, -3.0], [1.0, 2.0, 3.5]],
            background: [1.0, 0.5, -0.0],
            config_digest: std::array::from_fn(|i| i as u8),
            width: 800,
            height: 600,
            fov_x: 0.75,
            extra: [("author".to_owned(), "a test".to_owned()), ("writer".to_owned(), String::new())].into(),
        },
        gaussians: GaussianArrays { further: vec![further("age", 2, 2)], ..gaussians(2, 1) },
        coordinates: SceneCoordinateArrays {
            mean: [0.5, -0.25, 0.125],
            axes: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            std: [1.0, 2.0, 0.5],
            mapping: CoordinateMapping::default(),
        },
        feature_planes: hexplane(1, [2, 1, 1, 3], &[1, 2]),
        motion: motion(2),
    }
}

/// Bytes of one entry of the table.
pub const ENTRY: usize = 16;

/// Where the table of a stream begins.
pub fn table_at(bytes: &[u8]) -> usize {
    32 + u32_at(bytes, 16) as usize
}

/// A number at an offset.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// A number at an offset.
pub fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

/// Overwrites bytes.
pub fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes[at..at + new.len()].copy_from_slice(new);
}

/// Computes the header's checksum again, as an attacker would.
pub fn forge_header(bytes: &mut [u8]) {
    let end = (table_at(bytes) + ENTRY * u32_at(bytes, 12) as usize).min(bytes.len());
    let crc = crc32c::crc32c_append(crc32c::crc32c(&bytes[..28]), &bytes[32..end]);
    put(bytes, 28, &crc.to_le_bytes());
}

/// Where a section begins: where the ones before it end.
pub fn start(bytes: &[u8], index: usize) -> usize {
    let table = table_at(bytes);
    let length = |section: usize| u64_at(bytes, table + ENTRY * section + 8) as usize;
    table + ENTRY * u32_at(bytes, 12) as usize + (0..index).map(length).sum::<usize>()
}

/// Computes the checksum of a section again, then the header's.
pub fn forge_section(bytes: &mut [u8], index: usize) {
    let crc = crc32c::crc32c(payload(bytes, index));
    let entry = table_at(bytes) + ENTRY * index;
    put(bytes, entry + 4, &crc.to_le_bytes());
    forge_header(bytes);
}

/// The payload of a section of a stream.
pub fn payload(bytes: &[u8], index: usize) -> &[u8] {
    let length = u64_at(bytes, table_at(bytes) + ENTRY * index + 8) as usize;
    &bytes[start(bytes, index)..][..length]
}

/// A stream with another payload in a section; lengths and checksums fit.
pub fn with_payload(bytes: &[u8], index: usize, new: &[u8]) -> Vec<u8> {
    let sections = u32_at(bytes, 12) as usize;
    let mut forged = bytes[..table_at(bytes) + ENTRY * sections].to_vec();
    for section in 0..sections {
        let part = if section == index { new } else { payload(bytes, section) };
        let entry = table_at(bytes) + ENTRY * section;
        put(&mut forged, entry + 4, &crc32c::crc32c(part).to_le_bytes());
        put(&mut forged, entry + 8, &(part.len() as u64).to_le_bytes());
        forged.extend(part);
    }
    let length = forged.len() as u64;
    put(&mut forged, 20, &length.to_le_bytes());
    forge_header(&mut forged);
    forged
}
