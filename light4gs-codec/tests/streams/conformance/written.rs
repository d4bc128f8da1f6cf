//! Streams that the golden ones lack: written once, and others at random to compare decoders with.

use std::fs;

use crate::{
    common::{
        self,
        compression::{
            ALL_PARTS, Parts, Random, ShKind, compact_shape, condition, distribution, input, laplace_table, model,
            plane_coding, reference_shape, scene, sh_networks, sh_tables, step,
        },
        further, motion, sample,
    },
    operations, planes, random_networks,
};
use light4gs_codec::{
    CompressionInput, Condition, ContextModelArrays, CoordinateMapping, FeaturePlaneArrays, GaussianArrays,
    GaussianLayers, LatentArrays, MotionArrays, MotionNetwork, MotionOutput, MotionSource, NamedTensor, Network,
    PerGroup, PlanePrior, PlaneSource, Profile, SceneData, ShCoding, ShPrior, ShSource,
    attributes::AttributeSteps,
    encode, encode_compressed,
    network::{LayerKind, Operation, Value},
    plane_layout::PlaneAxes,
};

/// Its own stretch of the time, and no contraction.
const MAPPING: CoordinateMapping = CoordinateMapping {
    contracts: false,
    scale: [0.3, 0.7, 1.1],
    offset: [0.1, -0.2, 0.05],
    time_scale: 0.8,
    time_offset: 0.15,
};

pub(super) fn compressed(scene: &SceneData, input: &CompressionInput) -> Vec<u8> {
    encode_compressed(scene, input).unwrap().bytes
}

/// A motion whose network reads everything that it may and changes everything, partly in place.
fn full_motion(scene: &SceneData, random: &mut Random) -> MotionArrays {
    let features = scene.feature_planes.features() as u32;
    let rest = scene.gaussians.attribute("sh_rest").unwrap().width as u32;
    let attribute = |name: &str| MotionSource::Attribute(name.into());
    let mut sources =
        vec![MotionSource::Time, MotionSource::Point, attribute("means"), attribute("sh_dc"), attribute("age")];
    let mut channels = vec![1, 3, 3, 3, 2];
    for (source, own) in [(MotionSource::Features, features), (attribute("sh_rest"), rest)] {
        if own > 0 {
            sources.push(source);
            channels.push(own);
        }
    }
    let mut network = Network { inputs: channels.clone(), ..Network::default() };
    let inputs: Vec<Value> = (0..channels.len() as u32).map(Value).collect();
    let known = network.node(Operation::Concatenate, &inputs);
    let hidden = network.layer(known, random.linear(channels.iter().sum(), 8));
    let mut hidden = network.leaky_relu(hidden, 0.2);
    // Weights that sum to one.
    let most = network.node(Operation::GroupMaximum(8), &[hidden]);
    hidden = network.node(Operation::Subtract, &[hidden, most]);
    let share = network.node(Operation::Exponential, &[hidden]);
    let sum = network.node(Operation::GroupSum(8), &[share]);
    let share = network.node(Operation::Divide, &[share, sum]);
    let root = network.node(Operation::SquareRoot, &[share]);
    let clamped = network.node(Operation::Clamp { least: 0.1, most: 0.6 }, &[root]);
    let hidden = network.layer(clamped, random.layer(LayerKind::Convolution, 8, 12, 1, 4));
    let outputs = [
        (MotionOutput::Position, 3),
        (MotionOutput::NewLogScale, 3),
        (MotionOutput::Quaternion, 4),
        (MotionOutput::NewOpacityLogit, 1),
        (MotionOutput::Sh, 12),
    ];
    for (_, channels) in outputs {
        let output = network.layer(hidden, random.linear(12, channels));
        network.output(output);
    }
    let tensors = vec![
        NamedTensor { name: "a line".into(), shape: vec![12], values: (0..12).map(|i| 0.5 * i as f32).collect() },
        NamedTensor { name: "a number".into(), shape: vec![], values: vec![3.0] },
        NamedTensor { name: "nothing".into(), shape: vec![4, 0], values: vec![] },
        NamedTensor { name: "zeros".into(), shape: vec![2, 5], values: vec![0.0; 10] },
        NamedTensor {
            name: "parabolas".into(),
            shape: vec![3, 9],
            values: (0..27).map(|i| ((i % 9) * (i % 9) + i / 9) as f32).collect(),
        },
    ];
    let outputs = outputs.map(|(output, _)| output).to_vec();
    MotionArrays {
        kind: "test-all.sources_1".into(),
        network: Some(MotionNetwork { network, sources, outputs }),
        tensors,
    }
}

/// A network with every operation that the golden streams lack, over a plane, a latent and another plane.
fn rare_operations(random: &mut Random, channels: u32) -> Network {
    let (mut network, [below, latent, other]) = Network::new([channels, 1, channels]);
    let half = network.layer(below, random.layer(LayerKind::Halving, channels, 4, 3, 2));
    let half = network.leaky_relu(half, 0.3);
    let across = network.node(Operation::MeanOverWidth, &[half]);
    let across = network.node(Operation::Resize, &[across]);
    let across = network.node(Operation::Clamp { least: -0.5, most: 0.75 }, &[across]);
    let twice = network.layer(latent, random.layer(LayerKind::Doubling, 1, 3, 5, 1));
    let twice = network.relu(twice);
    let whole = network.node(Operation::Resize, &[twice]);
    let down = network.node(Operation::MeanOverHeight, &[other]);
    let down = network.node(Operation::Resize, &[down]);
    let down = network.layer(down, random.layer(LayerKind::Convolution, channels, 4, 7, 2));
    let square = network.node(Operation::Multiply, &[down, down]);
    let root = network.node(Operation::SquareRoot, &[square]);
    let exponential = network.node(Operation::Exponential, &[across]);
    let ratio = network.node(Operation::Divide, &[exponential, root]);
    let logarithm = network.node(Operation::Logarithm, &[ratio]);
    let picked = network.node(Operation::Select(vec![2, 0, 1, 1]), &[logarithm]);
    let maximum = network.node(Operation::GroupMaximum(2), &[picked]);
    let all = network.node(Operation::Concatenate, &[maximum, whole, across, picked]);
    let last = network.layer(all, random.layer(LayerKind::Convolution, 2 + 3 + 4 + 4, 2 * channels, 1, 1));
    network.output(last);
    network
}

fn rare_model(channels: u32, random: &mut Random) -> ContextModelArrays {
    let sources = vec![PlaneSource::LowerScale, PlaneSource::Latent, PlaneSource::SameScale(PlaneAxes::Xy)];
    let own = Some(Condition { network: 0, sources });
    // Two conditions that read anchors: one through a kernel of 3 and what follows at one place, one of kernel 7.
    let mut anchors = |kernel: u32, groups: u32| {
        let (mut network, [anchors]) = Network::new([channels]);
        let value =
            network.layer(anchors, random.layer(LayerKind::Checkerboard, channels, 2 * channels, kernel, groups));
        let value = network.leaky_relu(value, 0.01);
        let value = network.layer(value, random.linear(2 * channels, 2 * channels));
        network.output(value);
        network
    };
    let networks = [anchors(3, 1), anchors(7, channels)];
    let priors = vec![
        PlanePrior { conditions: vec![None, condition(2, &[PlaneSource::Anchors])], distribution: 1 },
        PlanePrior { conditions: vec![own, condition(3, &[PlaneSource::Anchors])], distribution: 1 },
    ];
    let mut all = vec![rare_operations(random, channels), distribution(random, channels, [3, 3])];
    all.extend(networks);
    ContextModelArrays {
        channels,
        latent: Some(LatentArrays { tables: vec![laplace_table(0.5)], medians: vec![0.1] }),
        networks: all,
        priors,
        plane_priors: vec![0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1],
        centers: PerGroup { space_only: 0.0, space_time: 1.0 },
    }
}

/// Networks of harmonics in which two priors share a degree, and one describes a degree and part of the next.
fn shared_degrees(features: u32) -> ShCoding {
    let mut random = Random::new(8);
    let prior = |random: &mut Random, sources: &[(ShSource, u32)], channels: u32| {
        let mut network = Network { inputs: sources.iter().map(|source| source.1).collect(), ..Network::default() };
        let inputs: Vec<_> = (0..sources.len() as u32).map(Value).collect();
        let known = network.node(Operation::Concatenate, &inputs);
        let output = network.layer(known, random.linear(network.inputs.iter().sum(), 2 * channels));
        network.output(output);
        ShPrior { network, sources: sources.iter().map(|source| source.0).collect() }
    };
    let single =
        [(ShSource::Position, 3), (ShSource::LogScale, 3), (ShSource::Quaternion, 4), (ShSource::OpacityLogit, 1)];
    let priors = vec![
        prior(&mut random, &[(ShSource::Dc, 3), (ShSource::SpaceFeatures, features)], 4),
        prior(&mut random, &[(ShSource::Dc, 3), (ShSource::Decoded, 4)], 8),
        prior(&mut random, &[&single[..], &[(ShSource::Decoded, 12)]].concat(), 12),
    ];
    ShCoding::Networks { step: 0.02, priors }
}

/// Gaussians in clusters, whose attributes follow from their places, so that prediction pays.
pub(super) fn clusters(count: usize) -> GaussianArrays {
    let mut random = Random::new(31);
    let mut gaussians = GaussianArrays { sh_degree: 1, ..GaussianArrays::default() };
    for index in 0..count {
        let cluster = (index % 7) as f32;
        let place: [f32; 3] = std::array::from_fn(|axis| cluster * (1.0 + axis as f32) + 0.2 * random.normal());
        let smooth = |k: f32| (place[0] * k).sin() + (place[1] - place[2]) * 0.1;
        gaussians.means.push(place);
        gaussians.log_scales.push(std::array::from_fn(|k| -4.0 + smooth(1.0 + k as f32) + 0.05 * random.normal()));
        gaussians.quats.push(std::array::from_fn(|k| smooth(0.3 * k as f32) + 0.02 * random.normal()));
        gaussians.opacity_logits.push(2.0 * smooth(0.7));
        gaussians.sh_dc.push([smooth(0.5), smooth(0.5) + 0.1, smooth(0.5) - 0.1]);
        gaussians.sh_rest.extend((0..9).map(|k| 0.1 * smooth(0.2 * k as f32) + 0.01 * random.normal()));
    }
    let mut wide = further("wide", 11, count);
    wide.values = (0..11 * count).map(|at| gaussians.means[at / 11][at % 3] * 0.1 * (at % 11) as f32).collect();
    let mut thrown = further("outliers", 1, count);
    thrown.values = (0..count).map(|at| if at % 37 == 5 { 40_000.0 } else { 0.01 * random.normal() }).collect();
    gaussians.further = vec![wide, thrown];
    gaussians
}

/// A stream with another order of its sections.
fn reordered(bytes: &[u8]) -> Vec<u8> {
    let (table, count) = (common::table_at(bytes), common::u32_at(bytes, 12) as usize);
    let mut forged = bytes[..table].to_vec();
    let order: Vec<usize> = (0..count).map(|index| (index * 5 + 3) % count).collect();
    for &index in &order {
        forged.extend(&bytes[table + common::ENTRY * index..][..common::ENTRY]);
    }
    order.iter().for_each(|&index| forged.extend(common::payload(bytes, index)));
    common::forge_header(&mut forged);
    forged
}

/// A stream with the Gaussians of another one as a further layer.
fn with_layer(bytes: &[u8], more: &[u8]) -> Vec<u8> {
    let (table, count) = (common::table_at(bytes), common::u32_at(bytes, 12) as usize);
    let end = table + common::ENTRY * count;
    // `gaussians` and `sh` are the first two sections.
    let further = &more[common::table_at(more)..][..2 * common::ENTRY];
    let payloads = [common::payload(more, 0), common::payload(more, 1)].concat();
    let mut forged = [&bytes[..end], further, &bytes[end..], &payloads].concat();
    let length = forged.len() as u64;
    common::put(&mut forged, 12, &(count as u32 + 2).to_le_bytes());
    common::put(&mut forged, 20, &length.to_le_bytes());
    common::forge_header(&mut forged);
    forged
}

/// Layers of Gaussians: under networks, under tables and under neither, in another order, and without loss.
fn layered() -> Vec<(&'static str, Vec<u8>)> {
    let scene = scene(29, 2, 4, [8, 4, 4, 4], &[1, 2]);
    let input = |profile, sh, layers| {
        let layers = GaussianLayers::new(layers);
        CompressionInput { sh, layers, ..input(&scene, profile, compact_shape(4, ALL_PARTS)) }
    };
    let networks = compressed(&scene, &input(Profile::Compact, sh_networks(ShKind::Everything, 2, 8), 2));
    let tables = compressed(&scene, &input(Profile::Paper, sh_tables(2), 3));
    let channels = compressed(&scene, &input(Profile::Compact, ShCoding::Channels { step: 0.02 }, 4));
    let without_loss = |indices: &[u32]| {
        let scene = sample();
        encode(&SceneData { gaussians: scene.gaussians.gathered(indices), ..scene }).unwrap()
    };
    vec![
        ("layers/reordered", reordered(&networks)),
        ("layers/networks", networks),
        ("layers/tables", tables),
        ("layers/channels", channels),
        ("layers/float32", with_layer(&without_loss(&[1]), &without_loss(&[0]))),
    ]
}

/// The streams of the set that are not golden ones, by name.
fn streams() -> Vec<(&'static str, Vec<u8>)> {
    let mut streams = Vec::new();
    let mut random = Random::new(40);

    // Every operation in motion, every source and every output; tensors of each shape.
    let mut all = scene(9, 2, 2, [6, 4, 5, 7], &[1, 2]);
    all.coordinates.mapping = MAPPING;
    all.gaussians.further[0].optional = false;
    all.motion = full_motion(&all, &mut random);
    streams.push(("motion-all", encode(&all).unwrap()));
    let steps = AttributeSteps::default().with("age", 0.01);
    let coding = CompressionInput {
        profile: Profile::Compact,
        planes: None,
        sh: sh_tables(2),
        attributes: steps.clone(),
        weights: Default::default(),
        layers: Default::default(),
    };
    streams.push(("motion-all-quantized", compressed(&all, &coding)));
    streams.push(("motion-operations", encode(&operations::scene()).unwrap()));

    // Networks of planes with rare operations.
    let rare = scene(3, 1, 4, [8, 12, 4, 4], &[1, 2]);
    let planes_coding = plane_coding(&rare.feature_planes, rare_model(4, &mut random), step(0.1));
    let others = input(&rare, Profile::Compact, compact_shape(4, ALL_PARTS));
    streams.push(("rare-operations", compressed(&rare, &CompressionInput { planes: Some(planes_coding), ..others })));

    // Planes of sizes of their own, with steps for each scale; coordinates without contraction.
    let (_, own_sizes) = planes::sets().pop().unwrap();
    let mut own = planes::scene_of(own_sizes);
    own.coordinates.mapping = MAPPING;
    let parts = Parts { inter_plane: false, ..ALL_PARTS };
    let steps_of_scales = [0.1, 0.03].map(|step| PerGroup { space_only: step, space_time: 2.0 * step }).to_vec();
    let coding =
        plane_coding(&own.feature_planes, model(compact_shape(4, parts), &own.feature_planes, 3), steps_of_scales);
    let others = input(&own, Profile::Paper, compact_shape(4, parts));
    streams.push(("own-sizes", compressed(&own, &CompressionInput { planes: Some(coding), ..others })));
    let (_, tri_plane) = planes::sets().remove(0);
    streams.push(("tri-plane", encode(&planes::scene_of(tri_plane)).unwrap()));

    // Spherical harmonics of degree 3 from all sources, and priors that share a degree; values far out, so with escapes.
    let mut far = scene(21, 3, 4, [8, 4, 4, 4], &[1, 2]);
    far.gaussians.sh_rest.iter_mut().step_by(53).for_each(|value| *value *= 900.0);
    far.feature_planes.planes[2].values.iter_mut().step_by(17).for_each(|value| *value = 1e4 - *value);
    far.coordinates.mapping.time_scale = 0.5;
    let mut coding = input(&far, Profile::Compact, reference_shape(4, ALL_PARTS));
    coding.sh = sh_networks(ShKind::Everything, 3, 8);
    streams.push(("far-values", compressed(&far, &coding)));
    let mut shared = scene(21, 2, 4, [8, 4, 4, 4], &[1, 2]);
    shared.gaussians.sh_rest.iter_mut().step_by(53).for_each(|value| *value *= 900.0);
    coding = input(&shared, Profile::Paper, compact_shape(4, ALL_PARTS));
    coding.sh = shared_degrees(8);
    streams.push(("shared-degrees", compressed(&shared, &coding)));

    // Many Gaussians: large nodes of positions, weights of the prediction, channels beyond the seventh.
    let many = SceneData {
        gaussians: clusters(420),
        feature_planes: FeaturePlaneArrays::default(),
        motion: MotionArrays::default(),
        ..sample()
    };
    let coding = CompressionInput {
        profile: Profile::Compact,
        planes: None,
        sh: ShCoding::Channels { step: 0.01 },
        attributes: AttributeSteps::default().with("wide", 0.02).with("outliers", 0.01),
        weights: Default::default(),
        layers: Default::default(),
    };
    streams.push(("clusters", compressed(&many, &coding)));

    // Equal Gaussians, enough of them for a section full of zeros.
    let one = clusters(1);
    let equal = GaussianArrays {
        means: vec![one.means[0]; 5000],
        log_scales: vec![one.log_scales[0]; 5000],
        quats: vec![one.quats[0]; 5000],
        opacity_logits: vec![one.opacity_logits[0]; 5000],
        sh_dc: vec![one.sh_dc[0]; 5000],
        ..GaussianArrays::default()
    };
    streams.push(("equal", compressed(&SceneData { gaussians: equal, ..many.clone() }, &coding)));

    // Nothing at all.
    let nothing = SceneData { gaussians: GaussianArrays::default(), ..many };
    streams.push(("nothing", encode(&nothing).unwrap()));
    streams.push(("nothing-quantized", compressed(&nothing, &coding)));

    let golden = common::compression::tiny(Profile::Compact);
    streams.push(("reordered", reordered(&compressed(&golden.0, &golden.1))));
    streams.extend(layered());
    streams
}

#[test]
#[ignore = "writes the streams of the conformance set anew, which only a change of the format may ask for"]
fn write_conformance_streams() {
    for (name, bytes) in streams().into_iter().chain(super::takes::takes()) {
        fs::write(format!("{}/streams/{name}.l4gs", super::FOLDER), bytes).unwrap();
    }
}

/// For `tests/conformance/compare`: streams of random networks, scenes and models.
#[test]
#[ignore = "LIGHT4GS_CONFORMANCE_RANDOM names no folder for random streams"]
fn write_random_streams() {
    let Ok(folder) = std::env::var("LIGHT4GS_CONFORMANCE_RANDOM") else { panic!("no folder") };
    for seed in 0..200 {
        let bytes = random_stream(seed);
        fs::write(format!("{folder}/{seed:03}.l4gs"), bytes).unwrap();
    }
}

fn random_stream(seed: u64) -> Vec<u8> {
    let mut random = Random::new(seed + 1000);
    let mut pick = |n: u32| ((random.uniform() + 1.0) * 0.5 * n as f32) as u32;
    let (count, degree) = (pick(30) as usize, pick(4) as u8);
    let m = random_networks::M;
    let resolution = [4 + 4 * pick(3), 4 + 4 * pick(2), 4, 4 + 4 * pick(2)];
    let profile = if pick(2) == 0 { Profile::Compact } else { Profile::Paper };
    let sh = pick(5);
    let mapped = pick(2) == 0;
    let quantized_age = pick(2) == 0;
    let mut scene = scene(count, degree, m, resolution, &[1, 2]);
    if mapped {
        scene.coordinates.mapping = CoordinateMapping { contracts: pick(2) == 0, ..MAPPING };
    }
    // Graphs are often refused: as many as it takes.
    for attempt in 0..400 {
        let mut random = Random::new(seed * 1000 + attempt);
        let mut pick = |n: u32| ((random.uniform() + 1.0) * 0.5 * n as f32) as u8;
        let nodes = 2 + pick(8) as usize;
        let choices: Vec<_> = (0..nodes).map(|_| (pick(37), [pick(256), pick(256), pick(256)])).collect();
        let sources = vec![PlaneSource::LowerScale, PlaneSource::Latent, PlaneSource::SameScale(PlaneAxes::Xy)];
        let network = random_networks::graph(&[m, 1, m], &choices, &mut random);
        let model = random_networks::model(network, sources, &mut random);
        let mut coding = input(&scene, profile, compact_shape(m, ALL_PARTS));
        coding.planes = Some(plane_coding(&scene.feature_planes, model, step(0.05)));
        coding.sh = match sh {
            0 => sh_tables(degree),
            1 => sh_networks(ShKind::Autoregressive, degree, 4),
            2 => sh_networks(ShKind::HexPlaneCoupled, degree, 4),
            3 => sh_networks(ShKind::Everything, degree, 4),
            _ => ShCoding::Channels { step: 0.013 },
        };
        if !quantized_age {
            coding.attributes = AttributeSteps::default();
        }
        scene.motion = if seed.is_multiple_of(3) { motion(4) } else { full_motion(&scene, &mut random) };
        if let Ok(encoded) = encode_compressed(&scene, &coding) {
            return encoded.bytes;
        }
    }
    panic!("no graph was legal")
}
