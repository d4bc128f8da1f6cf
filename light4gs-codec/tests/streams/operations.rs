//! The operations of networks at single places: values, refusals, bytes.

use crate::common;

use light4gs_codec::{
    MotionArrays, MotionNetwork, MotionOutput, MotionSource, Network, SceneData, decode, encode,
    network::{Layer, Node, Operation, Value},
};

/// The result of one node.
fn run(operation: Operation, inputs: &[&[f32]]) -> Vec<f32> {
    try_run(operation, inputs).unwrap()
}

fn try_run(operation: Operation, inputs: &[&[f32]]) -> Result<Vec<f32>, String> {
    let mut network =
        Network { inputs: inputs.iter().map(|values| values.len() as u32).collect(), ..Network::default() };
    let all: Vec<Value> = (0..inputs.len() as u32).map(Value).collect();
    let output = network.node(operation, &all);
    network.output(output);
    let inputs: Vec<Vec<f32>> = inputs.iter().map(|values| values.to_vec()).collect();
    network.evaluate(&inputs).map(|mut outputs| outputs.remove(0)).map_err(|error| error.to_string())
}

#[test]
fn operations_give_what_they_say() {
    use Operation::*;
    let six = [1.0, -2.0, 3.0, 4.0, -5.0, 6.0];
    assert_eq!(run(Add, &[&six, &[10.0, 20.0]]), [11.0, 18.0, 13.0, 24.0, 5.0, 26.0]);
    assert_eq!(run(Subtract, &[&six, &[1.0]]), [0.0, -3.0, 2.0, 3.0, -6.0, 5.0]);
    assert_eq!(run(Multiply, &[&six, &[1.0, 2.0, 3.0]]), [1.0, -4.0, 9.0, 4.0, -10.0, 18.0]);
    assert_eq!(run(Divide, &[&six, &[2.0, 4.0]]), [0.5, -0.5, 1.5, 1.0, -2.5, 1.5]);
    assert_eq!(run(Divide, &[&[1.0, -1.0], &[0.0]]), [f32::INFINITY, f32::NEG_INFINITY]);
    assert_eq!(run(SquareRoot, &[&[4.0, 2.0, 0.0]]), [2.0, 2f32.sqrt(), 0.0]);
    assert_eq!(run(Affine { scale: 2.0, offset: -1.0 }, &[&[0.5, 3.0]]), [0.0, 5.0]);
    assert_eq!(run(Clamp { least: -1.0, most: 2.0 }, &[&six]), [1.0, -1.0, 2.0, 2.0, -1.0, 2.0]);
    assert_eq!(run(GroupSum(3), &[&six]), [2.0, 5.0]);
    assert_eq!(run(GroupMaximum(2), &[&six]), [1.0, 4.0, 6.0]);
    assert_eq!(run(Select(vec![5, 0, 1, 2, 2]), &[&six]), [6.0, 1.0, -2.0, 3.0, 3.0]);
    let near = |found: Vec<f32>, expected: &[f32]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 3e-7 * b.abs()), "{found:?} {expected:?}");
    };
    near(run(Exponential, &[&[0.0, 1.0, -3.0, 20.0]]), &[1.0, 1f32.exp(), (-3f32).exp(), 20f32.exp()]);
    near(run(Logarithm, &[&[1.0, 2.0, 0.125, 1e30]]), &[0.0, 2f32.ln(), 0.125f32.ln(), 1e30f32.ln()]);
    assert_eq!(run(Exponential, &[&[-36.0, 1e9]]), [0.0, f32::INFINITY]);
    assert_eq!(run(Logarithm, &[&[0.0, 1e-20]]), [f32::NEG_INFINITY; 2]);
}

#[test]
fn operations_that_do_not_fit_are_refused() {
    use Operation::*;
    let refused = |operation, inputs: &[&[f32]]| try_run(operation, inputs).unwrap_err();
    let six = [1.0; 6];
    assert!(
        refused(Subtract, &[&six, &six[..4]]).contains("second input of node 0 is 4, expected 6, or a divisor of it")
    );
    assert!(refused(Divide, &[&six[..2], &six]).contains("second input of node 0 is 6"));
    assert!(refused(Divide, &[&six]).contains("inputs of node 0 (divide) is 1, expected 2"));
    assert!(refused(Exponential, &[&six, &six]).contains("inputs of node 0 (exponential) is 2, expected 1"));
    assert!(refused(Affine { scale: f32::NAN, offset: 0.0 }, &[&six]).contains("scale and offset"));
    assert!(refused(Clamp { least: 1.0, most: 0.0 }, &[&six]).contains("range"));
    assert!(refused(GroupSum(4), &[&six]).contains("channels of a group"));
    assert!(refused(GroupMaximum(0), &[&six]).contains("channels of a group"));
    assert!(refused(Select(Vec::new()), &[&six]).contains("selected channels"));
    assert!(refused(Select(vec![6]), &[&six]).contains("a selected channel"));
    // Selections may double channels from node to node.
    let mut network = Network { inputs: vec![1], ..Network::default() };
    for _ in 0..40 {
        let channels = 60_000;
        network.nodes.push(Node { operation: Select(vec![0; channels]), inputs: vec![Value(0)] });
    }
    network.output(Value(1));
    assert!(network.evaluate(&[vec![1.0]]).unwrap_err().to_string().contains("channels of all values"));
}

/// A scene without planes, whose Gaussians fade and turn: one network with all operations that `hexplane` does not use.
pub(crate) fn scene() -> SceneData {
    let mut scene =
        SceneData { feature_planes: Default::default(), gaussians: common::gaussians(11, 1), ..common::sample() };
    let (mut network, [time, means, quats, logits, dc]) = Network::new([1, 3, 4, 1, 3]);
    // From the time alone: a turn about z as a quaternion, and a center.
    let turn = network.layer(time, Layer::linear(vec![0.0, 0.0, 0.0, 1.0], vec![1.0, 0.0, 0.0, 0.0]));
    let center = network.constant(time, 1, vec![0.5, -1.0, 2.0]);
    // exp(-|x - c|² / 2) is the share of the turn that a Gaussian follows.
    let offset = network.node(Operation::Subtract, &[means, center]);
    let square = network.node(Operation::Multiply, &[offset, offset]);
    let square = network.node(Operation::GroupSum(3), &[square]);
    let half = network.node(Operation::Affine { scale: -0.5, offset: 0.0 }, &[square]);
    let weight = network.node(Operation::Exponential, &[half]);
    let turn = network.node(Operation::Multiply, &[turn, weight]);
    let rotation = network.node(Operation::Add, &[quats, turn]);
    network.output(rotation);
    // The logit of half the opacity: -ln(2 (1 + exp(-l)) - 1).
    let negative = network.node(Operation::Affine { scale: -1.0, offset: 0.0 }, &[logits]);
    let inverse = network.node(Operation::Exponential, &[negative]);
    let inverse = network.node(Operation::Affine { scale: 2.0, offset: 1.0 }, &[inverse]);
    let logit = network.node(Operation::Logarithm, &[inverse]);
    let logit = network.node(Operation::Affine { scale: -1.0, offset: 0.0 }, &[logit]);
    network.output(logit);
    // Red and blue change places.
    let swapped = network.node(Operation::Select(vec![2, 1, 0]), &[dc]);
    network.output(swapped);
    let attribute = |name: &str| MotionSource::Attribute(name.into());
    let sources = vec![
        MotionSource::Time,
        attribute("means"),
        attribute("quats"),
        attribute("opacity_logits"),
        attribute("sh_dc"),
    ];
    let outputs = vec![MotionOutput::NewQuaternion, MotionOutput::NewOpacityLogit, MotionOutput::NewSh];
    let motion = MotionNetwork { network, sources, outputs };
    scene.motion = MotionArrays { kind: "fades-and-turns".into(), network: Some(motion), tensors: Vec::new() };
    scene
}

#[test]
fn motion_reads_attributes_and_replaces_them() {
    let given = scene();
    let scene = decode(&encode(&given).unwrap()).unwrap();
    assert_eq!(scene, given);
    let evaluator = light4gs_codec::MotionEvaluator::new(&scene).unwrap();
    assert!(evaluator.moves() && evaluator.changes(MotionOutput::Sh));
    let canonical = &scene.gaussians;
    let mut moved = canonical.clone();
    let time = 0.75f32;
    // In parts, one of which begins within a block of eight.
    for range in [0..3, 3..9, 9..canonical.len()] {
        evaluator.apply(canonical, time, range, &mut moved);
    }
    // Values that are not kept are computed anew, to the same bits.
    let mut anew = canonical.clone();
    let forgetful = light4gs_codec::MotionEvaluator::keeping(&scene, 0).unwrap();
    forgetful.apply(canonical, time, 0..canonical.len(), &mut anew);
    assert_eq!(anew, moved);
    assert_eq!((&moved.means, &moved.log_scales), (&canonical.means, &canonical.log_scales));
    for i in 0..canonical.len() {
        let square: f32 = canonical.means[i].iter().zip([0.5, -1.0, 2.0]).map(|(x, c)| (x - c).powi(2)).sum();
        let weight = (-0.5 * square).exp();
        let turned = [1.0, 0.0, 0.0, time].map(|q| q * weight);
        for k in 0..4 {
            let expected = canonical.quats[i][k] + turned[k];
            assert!((moved.quats[i][k] - expected).abs() < 1e-5, "{i}");
        }
        let opacity = |logit: f32| 1.0 / (1.0 + (-f64::from(logit)).exp());
        let (before, after) = (opacity(canonical.opacity_logits[i]), opacity(moved.opacity_logits[i]));
        assert!((after - 0.5 * before).abs() < 1e-5, "{i}: {before} {after}");
        let [red, green, blue] = canonical.sh_dc[i];
        assert_eq!(moved.sh_dc[i], [blue, green, red]);
    }
    // Only degree 0 has an output, so the other harmonics stay.
    assert_eq!(moved.sh_rest, canonical.sh_rest);
    assert_eq!(scene.positions_at(time).unwrap(), canonical.means);
}

#[test]
fn sources_and_outputs_that_do_not_fit_are_refused() {
    let refused = |spoil: fn(&mut MotionNetwork)| {
        let mut scene = scene();
        spoil(scene.motion.network.as_mut().unwrap());
        encode(&scene).unwrap_err().to_string()
    };
    let message = refused(|motion| motion.sources[1] = MotionSource::Attribute("velocity".into()));
    assert!(message.contains("velocity") && message.contains("an attribute that the Gaussians have"), "{message}");
    assert!(refused(|motion| motion.sources[1] = MotionSource::Attribute("quats".into())).contains("expected 4"));
    assert!(refused(|motion| motion.outputs[0] = MotionOutput::NewPosition).contains("NewPosition"));
    // An attribute that is both added to and replaced.
    assert!(refused(|motion| motion.outputs[2] = MotionOutput::OpacityLogit).contains("OpacityLogit"));
}
