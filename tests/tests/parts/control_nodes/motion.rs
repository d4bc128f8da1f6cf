//! Poses and the regularizer of control nodes against plain operations of Burn and their derivatives, and against differences of
//! a plain float64 twin, which shares no code with the operations.

use burn::tensor::{Device, Tensor, TensorData};
use glam::{DMat3, DQuat, DVec3};
use light4gs_model::ops::node_poses::{NodeParameters, pose};
use light4gs_model::ops::node_regularizer::{Regularization, regularize};
use light4gs_tests::golden::{assert_close, assert_close_relative, cpu_devices, devices, values_of};
use light4gs_tests::random::Random;

const INPUTS: [&str; 5] = ["anchors", "log_radii", "translations", "rotations", "affinities"];

/// Parameters in the order of [`INPUTS`], row by row.
#[derive(Clone)]
struct Case {
    inputs: [Vec<f64>; 5],
    nodes: usize,
    knots: usize,
    affinities: usize,
    unit: f64,
    time: f64,
}

impl Case {
    fn random(nodes: usize, knots: usize, affinities: usize, time: f64, random: &mut Random) -> Self {
        let mut uniform = |count: usize, low: f64, high: f64| {
            (0..count).map(|_| f64::from(random.uniform(low, high) as f32)).collect::<Vec<f64>>()
        };
        let inputs = [
            uniform(3 * nodes, -1.0, 1.0),
            uniform(nodes, -2.0, 0.5),
            uniform(3 * nodes * knots, -0.5, 0.5),
            uniform(4 * nodes * knots, -0.7, 0.7),
            uniform(affinities * nodes, -1.0, 1.0),
        ];
        Self { inputs, nodes, knots, affinities, unit: 2.5, time: f64::from(time as f32) }
    }

    fn shapes(&self) -> [[usize; 2]; 5] {
        let Self { nodes, knots, affinities, .. } = *self;
        [[nodes, 3], [nodes, 1], [knots, 3 * nodes], [knots, 4 * nodes], [nodes, affinities]]
    }

    /// The output and the gradients of its sum with `weights`; where there are no affinities, none by these.
    fn run(
        &self,
        device: &Device,
        weights: &[f64],
        operation: impl Fn(NodeParameters, f32) -> Tensor<1>,
    ) -> (Vec<f32>, Vec<Vec<f32>>) {
        let device = device.clone().autodiff();
        let shapes = self.shapes();
        let leaf = |k: usize| {
            let values: Vec<f32> = self.inputs[k].iter().map(|value| *value as f32).collect();
            Tensor::<2>::from_data(TensorData::new(values, shapes[k]), &device).require_grad()
        };
        let leaves: Vec<Tensor<2>> = (0..if self.affinities > 0 { 5 } else { 4 }).map(leaf).collect();
        let parameters = NodeParameters {
            anchors: leaves[0].clone(),
            log_radii: leaves[1].clone(),
            translations: leaves[2].clone(),
            rotations: leaves[3].clone(),
            affinities: leaves.get(4).cloned(),
            unit: Tensor::from_floats([self.unit as f32], &device),
        };
        let output = operation(parameters, self.time as f32);
        let weights: Vec<f32> = weights.iter().map(|weight| *weight as f32).collect();
        let weights = Tensor::<1>::from_floats(weights.as_slice(), &device);
        let gradients = (output.clone() * weights).sum().backward();
        let gradient = |leaf: &Tensor<2>| leaf.grad(&gradients).map_or_else(Vec::new, |gradient| values_of(&gradient));
        (values_of(&output), leaves.iter().map(gradient).collect())
    }

    /// Position and rotation of each node at the time.
    fn motions(&self) -> Vec<(DVec3, DQuat)> {
        let spline = |inputs: &[f64], columns: usize, at: usize| -> f64 {
            let place = self.time * (self.knots - 3) as f64;
            let segment = (place as usize).min(self.knots - 4);
            let t = place - segment as f64;
            // The matrix of the uniform cubic B-spline.
            let weights = [
                (1.0 - t).powi(3),
                3.0 * t.powi(3) - 6.0 * t * t + 4.0,
                -3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0,
                t.powi(3),
            ];
            (0..4).map(|k| weights[k] / 6.0 * inputs[(segment + k) * columns * self.nodes + at]).sum()
        };
        let motion = |node: usize| {
            let [x, y, z] = [0, 1, 2].map(|axis| spline(&self.inputs[2], 3, 3 * node + axis));
            let [w, i, j, k] = [0, 1, 2, 3].map(|axis| spline(&self.inputs[3], 4, 4 * node + axis));
            (DVec3::new(x, y, z), DQuat::from_xyzw(i, j, k, 1.0 + w).normalize())
        };
        (0..self.nodes).map(motion).collect()
    }

    fn anchor(&self, node: usize) -> DVec3 {
        DVec3::from_slice(&self.inputs[0][3 * node..])
    }

    /// The posed nodes in float64.
    fn posed(&self) -> Vec<f64> {
        let mut posed = Vec::new();
        for (node, (translation, turn)) in self.motions().into_iter().enumerate() {
            let anchor = self.anchor(node);
            let matrix = DMat3::from_quat(turn);
            posed.extend((anchor * self.unit).to_array());
            posed.push(0.5 / (self.inputs[1][node].exp() * self.unit).powi(2));
            posed.extend(matrix.transpose().to_cols_array());
            posed.extend(((anchor + translation - matrix * anchor) * self.unit).to_array());
            posed.extend([turn.w, turn.x, turn.y, turn.z]);
            posed.extend_from_slice(&self.inputs[4][self.affinities * node..self.affinities * (node + 1)]);
        }
        posed
    }

    /// The regularizer in float64. The weights of neighbors are those of the parameters `weighed`.
    fn regularized(&self, weighed: &Case, rigidity: f64, smoothness: f64) -> f64 {
        let motions = self.motions();
        let (mut strain, mut weights) = (0.0, 0.0);
        for (i, (translation, turn)) in motions.iter().enumerate() {
            for (j, (translation_of_other, _)) in motions.iter().enumerate() {
                let distance = weighed.anchor(j).distance(weighed.anchor(i)) / weighed.inputs[1][i].exp();
                let weight = (-0.25 * distance * distance).exp();
                let before = self.anchor(j) - self.anchor(i);
                let now = before + translation_of_other - translation;
                strain += weight * (now - DMat3::from_quat(*turn) * before).length_squared();
                weights += weight;
            }
        }
        let bend = |knots: &[f64], columns: usize| {
            let count = knots.len() - 2 * columns;
            let second = |at: usize| knots[at] - 2.0 * knots[at + columns] + knots[at + 2 * columns];
            (0..count).map(|at| second(at).powi(2)).sum::<f64>() / count as f64
        };
        let bends = bend(&self.inputs[2], 3 * self.nodes) + 0.1 * bend(&self.inputs[3], 4 * self.nodes);
        rigidity * strain / weights + smoothness * bends
    }
}

fn posed(parameters: NodeParameters, time: f32) -> Tensor<1> {
    pose(parameters, time).flatten(0, 1)
}

const RIGIDITY: f64 = 0.75;
const SMOOTHNESS: f64 = 0.5;

fn regularized(parameters: NodeParameters, time: f32) -> Tensor<1> {
    let (rigidity, smoothness) = (RIGIDITY as f32, SMOOTHNESS as f32);
    regularize(parameters, Regularization { rigidity, smoothness, time })
}

/// One node, groups of nodes that are not full, as many as a workgroup has and one more; the fewest knots; both ends of time.
fn cases() -> impl Iterator<Item = (String, Case)> {
    let sizes = [
        (1, 4, 0, 0.5),
        (2, 4, 1, 0.0),
        (5, 9, 4, 1.0),
        (17, 7, 2, 0.31),
        (64, 12, 3, 0.77),
        (65, 5, 0, 0.5),
        (130, 6, 4, 0.99),
    ];
    sizes.into_iter().enumerate().map(|(seed, (nodes, knots, affinities, time))| {
        let mut random = Random::new(700 + seed as u64);
        let what = format!("{nodes} nodes, {knots} knots, {affinities} affinities, at {time}");
        (what, Case::random(nodes, knots, affinities, time, &mut random))
    })
}

/// Derivatives of a function of a case by every parameter.
fn differences(case: &Case, function: impl Fn(&Case) -> f64) -> Vec<Vec<f32>> {
    const STEP: f64 = 1e-5;
    let along = |k: usize, i: usize| {
        let at = |step: f64| {
            let mut moved = case.clone();
            moved.inputs[k][i] += step;
            function(&moved)
        };
        ((at(STEP) - at(-STEP)) / (2.0 * STEP)) as f32
    };
    (0..5).map(|k| (0..case.inputs[k].len()).map(|i| along(k, i)).collect()).collect()
}

#[test]
fn poses_and_gradients_are_those_of_the_twin() {
    for (what, case) in cases() {
        let weights = Random::new(720).normals(case.posed().len());
        let expected: Vec<f32> = case.posed().into_iter().map(|value| value as f32).collect();
        let loss = |case: &Case| case.posed().iter().zip(&weights).map(|(value, weight)| value * weight).sum();
        let gradients = differences(&case, loss);
        for (name, device) in devices() {
            let (found, found_gradients) = case.run(&device, &weights, posed);
            assert_close_relative(&format!("{name}, {what}: output"), &found, &expected, 3e-6);
            for (k, found) in found_gradients.iter().enumerate() {
                let what = format!("{name}, {what}: gradient of {}", INPUTS[k]);
                assert_close_relative(&what, found, &gradients[k], 2e-5);
            }
        }
    }
}

#[test]
fn the_regularizer_and_its_gradients_are_those_of_the_twin() {
    for (what, case) in cases().filter(|(_, case)| case.nodes < 100) {
        let loss = |moved: &Case| moved.regularized(&case, RIGIDITY, SMOOTHNESS);
        let expected = loss(&case) as f32;
        let gradients = differences(&case, |moved| 3.0 * loss(moved));
        for (name, device) in devices() {
            let (found, found_gradients) = case.run(&device, &[3.0], regularized);
            assert_close(&format!("{name}, {what}: loss"), &found, &[expected], 3e-6 * expected);
            for (k, found) in found_gradients.iter().enumerate() {
                // Weights take radii as constants, and affinities play no part.
                let what = format!("{name}, {what}: gradient of {}", INPUTS[k]);
                let none = matches!(INPUTS[k], "log_radii" | "affinities");
                assert_eq!(found.is_empty(), none, "{what}");
                if !none {
                    assert_close_relative(&what, found, &gradients[k], 3e-5);
                }
            }
        }
    }
}

/// One node alone has no neighbors; nodes that all make one rigid motion are where their neighbors see them.
#[test]
fn one_rigid_motion_costs_nothing() {
    let mut case = Case::random(6, 5, 0, 0.4, &mut Random::new(730));
    let turn = [0.2, 0.3, -0.4, 0.5];
    let quat = DQuat::from_xyzw(turn[1], turn[2], turn[3], 1.0 + turn[0]).normalize();
    for node in 0..case.nodes {
        let moved = quat * case.anchor(node) + DVec3::new(0.1, -0.3, 0.2) - case.anchor(node);
        for knot in 0..case.knots {
            let row = knot * case.nodes + node;
            case.inputs[2][3 * row..3 * row + 3].copy_from_slice(&moved.to_array());
            case.inputs[3][4 * row..4 * row + 4].copy_from_slice(&turn);
        }
    }
    for (name, device) in devices() {
        let (loss, gradients) = case.run(&device, &[1.0], regularized);
        assert!(loss[0].abs() < 1e-12, "{name}: {loss:?}");
        assert!(gradients.iter().flatten().all(|gradient| gradient.abs() < 1e-6), "{name}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let pool = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let pools = [pool(1), pool(2), pool(5)];
    let case = Case::random(130, 6, 2, 0.6, &mut Random::new(740));
    let expected = pools[0].install(|| case.run(&Device::flex(), &[1.0], regularized));
    for (name, device) in cpu_devices() {
        for pool in &pools {
            assert!(pool.install(|| case.run(&device, &[1.0], regularized)) == expected, "{name}");
        }
    }
}

#[test]
#[should_panic(expected = "rotations must be [K, 4 B]")]
fn a_wrong_shape_is_named() {
    let device = Device::flex();
    let zeros = |shape: [usize; 2]| Tensor::<2>::zeros(shape, &device);
    let parameters = NodeParameters {
        anchors: zeros([5, 3]),
        log_radii: zeros([5, 1]),
        translations: zeros([6, 15]),
        rotations: zeros([5, 20]),
        affinities: None,
        unit: Tensor::ones([1], &device),
    };
    pose(parameters, 0.5);
}
