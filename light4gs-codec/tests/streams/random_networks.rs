//! Unusual networks: random graphs, huge shapes, and networks that would take very long.
//!
//! Whatever the nodes are, a file that holds them either decodes to the scene that the encoder promised or is refused,
//! soon and in little memory. It never crashes the decoder.

use crate::common;

use std::time::{Duration, Instant};

use common::compression::{
    ALL_PARTS, Random, compact_shape, condition, distribution, input, plane_coding, scene, step,
};
use light4gs_codec::{
    CodecError, CompressionInput, Condition, ContextModelArrays, LatentArrays, Limits, Network, PlanePrior,
    PlaneSource, Profile, decode, decode_with_limits, encode_compressed, encode_compressed_with_limits, info,
    network::{Layer, LayerKind, Node, Operation, Value},
    plane_layout::PlaneAxes,
};
use proptest::prelude::*;

pub(crate) const M: u32 = 2;

/// A node of any kind that reads any values before it; often its channels fit.
fn node(choice: u8, picks: [u8; 3], channels: &[u32], random: &mut Random) -> Node {
    let value = |pick: u8| Value(u32::from(pick) % channels.len() as u32);
    let first = value(picks[0]);
    let inputs = channels[first.0 as usize];
    let mut one = |kind, kernel, groups| Operation::Layer(random.layer(kind, inputs, 2 * M, kernel, groups));
    let operation = match choice {
        0..=2 => one(LayerKind::Convolution, 1, 1),
        3 => one(LayerKind::Convolution, 3, 1),
        4 => one(LayerKind::Convolution, 7, if inputs.is_multiple_of(2) { 2 } else { 1 }),
        5 => one(LayerKind::Halving, 3, 1),
        6 | 7 => one(LayerKind::Doubling, 5, 1),
        8 => one(LayerKind::Checkerboard, 5, 1),
        9 => Operation::Relu,
        10 => Operation::LeakyRelu(0.3),
        11..=13 => Operation::Resize,
        14 => Operation::MeanOverHeight,
        15 => Operation::MeanOverWidth,
        16 => Operation::Transpose,
        17..=19 => Operation::Spread,
        20..=22 => Operation::Concatenate,
        23 => Operation::Add,
        24 => Operation::Multiply,
        25 => Operation::Subtract,
        26 => Operation::Divide,
        27 => Operation::Exponential,
        28 => Operation::Logarithm,
        29 => Operation::SquareRoot,
        30 => Operation::Affine { scale: -1.5, offset: 0.25 },
        31 => Operation::Clamp { least: -0.5, most: 2.0 },
        32 => Operation::GroupSum(2),
        33 => Operation::GroupMaximum(if inputs.is_multiple_of(3) { 3 } else { inputs }),
        _ => Operation::Select(picks.iter().map(|&pick| u32::from(pick) % inputs).collect()),
    };
    let inputs = match operation {
        Operation::Concatenate => picks.iter().map(|&pick| value(pick)).collect(),
        Operation::Add | Operation::Multiply | Operation::Subtract | Operation::Divide => {
            vec![first, value(picks[1])]
        }
        _ => vec![first],
    };
    Node { operation, inputs }
}

/// A graph over some inputs, with a last node that makes it fit: a linear layer at the plane's size.
pub(crate) fn graph(inputs: &[u32], choices: &[(u8, [u8; 3])], random: &mut Random) -> Network {
    let mut network = Network { inputs: inputs.to_vec(), ..Network::default() };
    let mut channels = inputs.to_vec();
    for &(choice, picks) in choices {
        let node = node(choice, picks, &channels, random);
        channels.push(match &node.operation {
            Operation::Layer(layer) => layer.outputs,
            Operation::Concatenate => node.inputs.iter().map(|value| channels[value.0 as usize]).sum(),
            Operation::GroupSum(group) | Operation::GroupMaximum(group) => {
                (channels[node.inputs[0].0 as usize] / group).max(1)
            }
            Operation::Select(selected) => selected.len() as u32,
            _ => channels[node.inputs[0].0 as usize],
        });
        network.nodes.push(node);
    }
    let last = Value(channels.len() as u32 - 1);
    let resized = network.node(Operation::Resize, &[last]);
    let output = network.layer(resized, random.layer(LayerKind::Convolution, channels[last.0 as usize], 2 * M, 1, 1));
    network.output(output);
    network
}

/// A model in which one graph predicts every plane from all kinds of sources.
pub(crate) fn model(graph: Network, sources: Vec<PlaneSource>, random: &mut Random) -> ContextModelArrays {
    let own = Some(Condition { network: 0, sources });
    let priors = vec![
        PlanePrior { conditions: vec![None, None], distribution: 1 },
        PlanePrior { conditions: vec![own, None], distribution: 1 },
    ];
    let latent = LatentArrays { tables: vec![common::compression::laplace_table(0.5)], medians: vec![0.1] };
    ContextModelArrays {
        channels: M,
        latent: Some(latent),
        networks: vec![graph, distribution(random, M, [3, 3])],
        priors,
        plane_priors: vec![0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1],
        ..ContextModelArrays::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn any_graph_decodes_or_is_refused(
        choices in prop::collection::vec((0u8..37, any::<[u8; 3]>()), 0..10),
        seed in any::<u64>(),
    ) {
        let mut random = Random::new(seed);
        let sources = vec![PlaneSource::LowerScale, PlaneSource::Latent, PlaneSource::SameScale(PlaneAxes::Xy)];
        let network = graph(&[M, 1, M], &choices, &mut random);
        let scene = scene(2, 0, M, [4, 8, 4, 4], &[1, 2]);
        let model = model(network, sources, &mut random);
        let others = input(&scene, Profile::Paper, compact_shape(M, ALL_PARTS));
        // Whether there is a latent depends on the sources alone, so the coding can be made before the model is
        // checked.
        let planes = Some(plane_coding(&scene.feature_planes, model, step(0.1)));
        match encode_compressed(&scene, &CompressionInput { planes, ..others }) {
            Ok(encoded) => {
                let decoded = decode(&encoded.bytes).unwrap();
                prop_assert_eq!(&decoded, &encoded.decoded);
                for (given, decoded) in scene.feature_planes.planes.iter().zip(&decoded.feature_planes.planes) {
                    let near = given.values.iter().zip(&decoded.values).all(|(a, b)| (a - b).abs() < 0.0501);
                    prop_assert!(near);
                }
            }
            Err(error) => prop_assert!(!error.is_internal(), "{}", error),
        }
    }

    /// A legal stream whose description is overwritten, with checksums that fit.
    #[test]
    fn any_bytes_as_a_description(
        at in 0usize..160,
        new in prop::collection::vec(any::<u8>(), 1..12),
        motion in any::<bool>(),
    ) {
        let (scene, input) = common::compression::tiny(Profile::Compact);
        let bytes = STREAM.get_or_init(|| encode_compressed(&scene, &input).unwrap().bytes);
        let section = if motion { 3 } else { 5 };
        let mut payload = common::payload(bytes, section).to_vec();
        let at = at % payload.len();
        let end = (at + new.len()).min(payload.len());
        payload[at..end].copy_from_slice(&new[..end - at]);
        let forged = common::with_payload(bytes, section, &payload);
        let limits = Limits { nanoseconds: 20_000_000, ..Limits::default() };
        let begin = Instant::now();
        if let Ok(scene) = decode_with_limits(&forged, &limits) {
            let _ = scene.positions_at(0.5);
        }
        let _ = info(&forged);
        prop_assert!(begin.elapsed() < Duration::from_secs(10));
    }
}

static STREAM: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();

/// The error of the encoder for a model with this network for the higher scales.
fn refusal(network: Network, sources: &[PlaneSource]) -> CodecError {
    let mut random = Random::new(3);
    let scene = scene(0, 0, M, [64, 64, 64, 64], &[1, 2]);
    let model = model(network, sources.to_vec(), &mut random);
    let others = input(&scene, Profile::Paper, compact_shape(M, ALL_PARTS));
    let planes = Some(plane_coding(&scene.feature_planes, model, step(0.1)));
    match encode_compressed_with_limits(&scene, &CompressionInput { planes, ..others }, &Limits::default()) {
        Ok(_) => panic!("the network is within the limits"),
        Err(error) => error,
    }
}

#[test]
fn bombs_are_refused_before_they_go_off() {
    let begin = Instant::now();
    let lower = [PlaneSource::LowerScale];
    let over = |error: CodecError| assert!(matches!(error, CodecError::OverLimit { .. }), "{error}");

    // Sizes that double from node to node.
    let (mut network, [mut value]) = Network::new([M]);
    let mut random = Random::new(1);
    for _ in 0..40 {
        value = network.layer(value, random.layer(LayerKind::Doubling, M, M, 5, 1));
    }
    let resized = network.node(Operation::Resize, &[value]);
    let output = network.layer(resized, random.linear(M, 2 * M));
    network.output(output);
    over(refusal(network, &lower));

    // Channels that double from node to node.
    let (mut network, [mut value]) = Network::new([M]);
    for _ in 0..60 {
        value = network.node(Operation::Concatenate, &[value, value]);
    }
    network.output(value);
    over(refusal(network, &lower));

    // Wide layers: the file would be small, since weights of zero take nearly no bytes.
    let (mut network, [value]) = Network::new([M]);
    let wide =
        |inputs: u32, outputs: u32| Layer::linear(vec![0.0; (inputs * outputs) as usize], vec![0.0; outputs as usize]);
    let value = network.node(Operation::Resize, &[value]);
    let value = network.layer(value, wide(M, 1400));
    let value = network.layer(value, wide(1400, 1400));
    let output = network.layer(value, wide(1400, 2 * M));
    network.output(output);
    over(refusal(network.clone(), &lower));
    let value = network.layer(Value(3), wide(1400, 1400));
    network.outputs = vec![network.layer(value, wide(1400, 2 * M))];
    over(refusal(network, &lower));

    // More nodes than a network may have.
    let (mut network, [mut value]) = Network::new([M]);
    for _ in 0..300 {
        value = network.relu(value);
    }
    network.output(value);
    over(refusal(network, &lower));

    // Many maps at once.
    let (mut network, [value]) = Network::new([M]);
    let value = network.node(Operation::Resize, &[value]);
    let value = network.layer(value, random.layer(LayerKind::Convolution, M, 2000, 3, 1));
    let output = network.layer(value, random.layer(LayerKind::Convolution, 2000, 2 * M, 3, 1));
    network.output(output);
    over(refusal(network, &lower));
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
}

#[test]
fn a_node_cannot_read_itself_or_what_comes_later() {
    for later in [1, 2, 3, u32::MAX] {
        let (mut network, [value]) = Network::new([M]);
        network.node(Operation::Relu, &[Value(later)]);
        let output = network.layer(value, Random::new(1).linear(M, 2 * M));
        network.output(output);
        let error = refusal(network, &[PlaneSource::LowerScale]).to_string();
        assert!(error.contains("a node reads only values before it"), "{error}");
    }
    assert!(condition(0, &[]).is_some());
}
