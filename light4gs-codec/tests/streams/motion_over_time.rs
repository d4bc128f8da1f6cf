//! Values that are computed once for all times, and sums that are one step, against the network run anew for each
//! Gaussian.

use crate::common;

use common::compression::Random;
use light4gs_codec::{
    MotionArrays, MotionEvaluator, MotionNetwork, MotionOutput, MotionSource, Network, SceneCoordinateArrays,
    SceneData,
    network::{Layer, Operation, Value},
};
use proptest::prelude::*;

const GAUSSIANS: usize = 19;
/// Values with more channels are not read by operations whose results are wider.
const WIDEST: u32 = 48;

/// A network of operations at single places, with the channels of its values.
struct Pointwise {
    network: Network,
    channels: Vec<u32>,
    random: Random,
}

impl Pointwise {
    fn node(&mut self, operation: Operation, inputs: &[Value], channels: u32) -> Value {
        self.channels.push(channels);
        self.network.node(operation, inputs)
    }

    fn of(&self, value: Value) -> u32 {
        self.channels[value.0 as usize]
    }

    /// A value whose channels divide those of another one: the next such value after a pick, or that one itself.
    fn divisor(&self, of: Value, pick: u8) -> Value {
        let count = self.channels.len();
        let from = |step: usize| Value(((usize::from(pick) + step) % count) as u32);
        (0..count).map(from).find(|&value| self.of(of).is_multiple_of(self.of(value))).unwrap_or(of)
    }

    fn add(&mut self, choice: u8, picks: [u8; 3]) {
        let a = Value(u32::from(picks[0]) % self.channels.len() as u32);
        let (inputs, b) = (self.of(a), self.divisor(a, picks[1]));
        let outputs = 1 + u32::from(picks[2]) % 6;
        match choice {
            0..=2 => {
                let weight = self.random.normals((inputs * outputs) as usize, if choice == 2 { 1e-9 } else { 1.0 });
                let layer = Layer::linear(weight, self.random.normals(outputs as usize, 1.0));
                self.node(Operation::Layer(layer), &[a], outputs);
            }
            3 => {
                let numbers = self.random.normals(outputs as usize, 3.0);
                let layer = Layer::linear(vec![0.0; (inputs * outputs) as usize], numbers);
                self.node(Operation::Layer(layer), &[a], outputs);
            }
            4..=7 => {
                let all = [Operation::Add, Operation::Subtract, Operation::Multiply, Operation::Divide];
                self.node(all[usize::from(choice - 4)].clone(), &[a, b], inputs);
            }
            8..=13 => {
                let all = [
                    Operation::Relu,
                    Operation::LeakyRelu(0.3),
                    Operation::Exponential,
                    Operation::Logarithm,
                    Operation::SquareRoot,
                    Operation::Affine { scale: -7.5, offset: 0.25 },
                ];
                self.node(all[usize::from(choice - 8)].clone(), &[a], inputs);
            }
            14 | 15 if inputs + self.of(b) <= WIDEST => {
                self.node(Operation::Concatenate, &[a, b], inputs + self.of(b));
            }
            16 => {
                let picked = (0..outputs * 4).map(|i| (i * 7 + u32::from(picks[1])) % inputs).collect();
                self.node(Operation::Select(picked), &[a], outputs * 4);
            }
            17 | 18 => {
                let group = if picks[2].is_multiple_of(2) { inputs } else { self.of(b) };
                let reduce = if choice == 17 { Operation::GroupSum(group) } else { Operation::GroupMaximum(group) };
                self.node(reduce, &[a], inputs / group);
            }
            // A blend.
            _ => {
                let product = self.node(Operation::Multiply, &[a, b], inputs);
                let group = self.of(b);
                self.node(Operation::GroupSum(group), &[product], inputs / group);
            }
        }
    }

    /// Channels of a value as an output.
    fn output(&mut self, value: Value, channels: u32) {
        let picked = (0..channels).map(|i| (i * 5) % self.of(value)).collect();
        let output = self.node(Operation::Select(picked), &[value], channels);
        self.network.output(output);
    }
}

fn scene(choices: &[(u8, [u8; 3])], seed: u64) -> SceneData {
    let inputs = vec![1, 3, 4, 5];
    let network = Network { inputs: inputs.clone(), ..Network::default() };
    let mut random = Random::new(seed);
    let mut gaussians = common::gaussians(GAUSSIANS, 0);
    gaussians.means.iter_mut().for_each(|mean| *mean = std::array::from_fn(|_| random.normal()));
    let mut further = common::further("share", 5, GAUSSIANS);
    // Like weights: many zeros, among them whole blocks.
    further.values =
        (0..further.values.len()).map(|i| if i / 45 == 1 { 0.0 } else { random.normal().max(0.0) }).collect();
    gaussians.further = vec![further];
    let mut pointwise = Pointwise { network, channels: inputs, random };
    choices.iter().for_each(|&(choice, picks)| pointwise.add(choice, picks));
    let last = Value(pointwise.channels.len() as u32 - 1);
    pointwise.output(last, 3);
    let before = Value(last.0.saturating_sub(1));
    pointwise.output(before, 4);
    let sources = ["means", "quats", "share"].map(|name| MotionSource::Attribute(name.into()));
    let motion = MotionNetwork {
        network: pointwise.network,
        sources: [MotionSource::Time].into_iter().chain(sources).collect(),
        outputs: vec![MotionOutput::NewPosition, MotionOutput::NewQuaternion],
    };
    SceneData {
        gaussians,
        coordinates: SceneCoordinateArrays::default(),
        feature_planes: Default::default(),
        motion: MotionArrays { kind: "random".into(), network: Some(motion), tensors: Vec::new() },
        ..common::sample()
    }
}

/// NaN is NaN, whichever.
fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|number| if number.is_nan() { f32::NAN.to_bits() } else { number.to_bits() }).collect()
}

fn check(scene: &SceneData) {
    let network = &scene.motion.network.as_ref().unwrap().network;
    let given = &scene.gaussians;
    let evaluators = [0, 1 << 20].map(|most_bytes| MotionEvaluator::keeping(scene, most_bytes).unwrap());
    for time in [0.0, 0.3, 1.0] {
        let row = |name: &str, gaussian: usize| {
            let attribute = given.attribute(name).unwrap();
            attribute.values[gaussian * attribute.width..][..attribute.width].to_vec()
        };
        let expected = (0..GAUSSIANS).map(|gaussian| {
            let inputs = ["means", "quats", "share"].map(|name| row(name, gaussian));
            network.evaluate(&[vec![vec![time]], inputs.to_vec()].concat()).unwrap()
        });
        let (positions, quats): (Vec<_>, Vec<_>) =
            expected.map(|mut outputs| (outputs.remove(0), outputs.remove(0))).unzip();
        for evaluator in &evaluators {
            let mut moved = given.clone();
            // In parts, one of which begins within a block of eight.
            [0..5, 5..16, 16..GAUSSIANS].into_iter().for_each(|range| evaluator.apply(given, time, range, &mut moved));
            assert_eq!(bits(moved.means.as_flattened()), bits(&positions.concat()));
            assert_eq!(bits(moved.quats.as_flattened()), bits(&quats.concat()));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]
    #[test]
    fn kept_values_change_no_bit(
        choices in prop::collection::vec((0u8..24, any::<[u8; 3]>()), 1..14),
        seed in any::<u64>(),
    ) {
        check(&scene(&choices, seed));
    }
}

/// Numbers that do not even depend on the time are blended as soon as the scene is opened.
#[test]
fn constants_are_blended() {
    let mut scene = scene(&[], 1);
    let network = &mut scene.motion.network.as_mut().unwrap().network;
    *network = Network { inputs: network.inputs.clone(), ..Network::default() };
    let (time, share) = (Value(0), Value(3));
    let numbers = (0..35).map(|i| i as f32 - 9.5).collect();
    let numbers = network.layer(time, Layer::linear(vec![0.0; 35], numbers));
    let product = network.node(Operation::Multiply, &[numbers, share]);
    let blended = network.node(Operation::GroupSum(5), &[product]);
    let position = network.node(Operation::Select(vec![0, 1, 2]), &[blended]);
    let quaternion = network.node(Operation::Select(vec![3, 4, 5, 6]), &[blended]);
    network.outputs = vec![position, quaternion];
    check(&scene);
}

/// Poses that are infinite or not a number reach every Gaussian, even with a weight of 0.
#[test]
fn poses_without_a_number_are_not_left_out() {
    for numbers in [[f32::INFINITY, 1.0], [1.0, f32::NAN]] {
        let mut scene = scene(&[], 1);
        let network = &mut scene.motion.network.as_mut().unwrap().network;
        *network = Network { inputs: network.inputs.clone(), ..Network::default() };
        let (time, share) = (Value(0), Value(3));
        // The logarithm of 0 is infinite, that of -1 is no number.
        let finite = numbers.map(|number| {
            if number.is_nan() {
                -1.0
            } else if number.is_infinite() {
                0.0
            } else {
                2.0
            }
        });
        let poses = network.layer(time, Layer::linear(vec![1e-3; 2], finite.to_vec()));
        let poses = network.node(Operation::Affine { scale: 1.0, offset: -0.0 }, &[poses]);
        let poses = network.node(Operation::Logarithm, &[poses]);
        let poses = network.node(Operation::Select((0..35).map(|i| u32::from(i % 5 == 2)).collect()), &[poses]);
        let product = network.node(Operation::Multiply, &[poses, share]);
        let blended = network.node(Operation::GroupSum(5), &[product]);
        let position = network.node(Operation::Select(vec![0, 1, 2]), &[blended]);
        let quaternion = network.node(Operation::Select(vec![3, 4, 5, 6]), &[blended]);
        network.outputs = vec![position, quaternion];
        check(&scene);
        let mut moved = scene.gaussians.clone();
        MotionEvaluator::new(&scene).unwrap().apply(&scene.gaussians, 0.0, 0..GAUSSIANS, &mut moved);
        assert!(moved.means[10].iter().all(|number| number.is_nan()), "{:?}", moved.means[10]);
    }
}
