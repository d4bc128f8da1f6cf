//! Linear blend skinning against plain operations of Burn and their derivatives, and against differences of a plain float64 twin,
//! which shares no code with the operation.

use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor, TensorData};
use light4gs_model::ops::columns::columns;
use light4gs_model::ops::skinning::{Moved, SkinningInputs, skin};
use light4gs_tests::golden::{assert_close, assert_close_relative, cpu_devices, devices, values_of};
use light4gs_tests::random::Random;

const INPUTS: [&str; 6] = ["means", "quats", "stillness", "anchors", "precisions", "poses"];
/// The node that stands still.
const STILL: [f64; 16] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// Inputs in the order of [`INPUTS`], row by row. With H affinities, a row of the stillness has `1 + H` numbers, and one of the
/// anchors `3 + H`.
#[derive(Clone)]
struct Case {
    inputs: [Vec<f64>; 6],
    affinities: usize,
}

impl Case {
    /// Gaussians and nodes in a box; poses of any numbers, since nothing asks for rotations.
    fn random(count: usize, nodes: usize, affinities: usize, random: &mut Random) -> Self {
        let mut uniform = |count: usize, low: f64, high: f64| (0..count).map(|_| random.uniform(low, high)).collect();
        let inputs: [Vec<f64>; 6] = [
            uniform(3 * count, -1.0, 1.0),
            uniform(4 * count, -1.0, 1.0),
            uniform((1 + affinities) * count, -3.0, 1.0),
            uniform((3 + affinities) * nodes, -1.0, 1.0),
            uniform(nodes, 0.5, 6.0),
            uniform(16 * nodes, -1.0, 1.0),
        ];
        Self { inputs, affinities }
    }

    /// Columns of the inputs.
    fn columns(&self) -> [usize; 6] {
        [3, 4, 1 + self.affinities, 3 + self.affinities, 1, 16]
    }

    fn leaves(&self, device: &Device) -> [Tensor<2>; 6] {
        std::array::from_fn(|k| {
            let values: Vec<f32> = self.inputs[k].iter().map(|value| *value as f32).collect();
            let columns = self.columns()[k];
            let shape = [values.len() / columns, columns];
            Tensor::from_data(TensorData::new(values, shape), device).require_grad()
        })
    }

    /// Output, and gradients of its sum with `weights`.
    fn run(
        &self,
        device: &Device,
        weights: &[f64],
        operation: impl Fn(SkinningInputs) -> Tensor<2>,
    ) -> (Vec<f32>, [Vec<f32>; 6]) {
        let leaves = self.leaves(&device.clone().autodiff());
        let [means, quats, stillness, anchors, precisions, poses] = leaves.clone();
        let places = anchors.clone().narrow(1, 0, 3);
        let mut nodes = vec![places, precisions, poses];
        if self.affinities > 0 {
            nodes.push(anchors.narrow(1, 3, self.affinities));
        }
        let affinities = (self.affinities > 0).then(|| columns(stillness.clone(), 1..1 + self.affinities));
        let inputs = SkinningInputs::new(means, quats, columns(stillness, 0..1), Tensor::cat(nodes, 1));
        let moved = operation(SkinningInputs { affinities, ..inputs });
        let weights: Vec<f32> = weights.iter().map(|weight| *weight as f32).collect();
        let weights = Tensor::<2>::from_data(TensorData::new(weights, moved.dims()), &moved.device());
        let gradients = (moved.clone() * weights).sum().backward();
        (values_of(&moved), leaves.map(|leaf| values_of(&leaf.grad(&gradients).expect("a leaf has a gradient"))))
    }

    /// Every number of the output in float64. The weights are those of Gaussians at `weighed` `[N, 3]`.
    fn twin(&self, weighed: &[f64]) -> Vec<f64> {
        let [means, quats, stillness, anchors, precisions, poses] = &self.inputs;
        let [_, _, own, place, ..] = self.columns();
        let mut moved = Vec::new();
        for i in 0..stillness.len() / own {
            let mut logits: Vec<f64> = (0..precisions.len())
                .map(|b| {
                    let squared: f64 = (0..3).map(|k| (weighed[3 * i + k] - anchors[place * b + k]).powi(2)).sum();
                    let liked = (0..self.affinities).map(|k| stillness[own * i + 1 + k] * anchors[place * b + 3 + k]);
                    liked.sum::<f64>() - precisions[b] * squared
                })
                .collect();
            logits.push(stillness[own * i]);
            let largest = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = logits.iter().map(|logit| (logit - largest).exp()).sum();
            let mut pose = [0.0; 16];
            for (row, logit) in poses.chunks_exact(16).chain([STILL.as_slice()]).zip(&logits) {
                for (blended, value) in pose.iter_mut().zip(row) {
                    *blended += (logit - largest).exp() / sum * value;
                }
            }
            for row in 0..3 {
                moved.push((0..3).map(|k| pose[3 * row + k] * means[3 * i + k]).sum::<f64>() + pose[9 + row]);
            }
            let quat = |q: &[f64]| glam::DQuat::from_xyzw(q[1], q[2], q[3], q[0]);
            // Not `*`, which asks for unit quaternions in debug builds.
            let (a, b) = (quat(&pose[12..]), quat(&quats[4 * i..]));
            let (u, v) = (a.xyz(), b.xyz());
            moved.push(a.w * b.w - u.dot(v));
            moved.extend((a.w * v + b.w * u + u.cross(v)).to_array());
        }
        moved
    }
}

/// Weights of a loss over the output.
fn loss_weights(count: usize, random: &mut Random) -> Vec<f64> {
    random.normals(7 * count)
}

/// The operation in plain ones.
fn plain(inputs: SkinningInputs) -> Tensor<2> {
    let SkinningInputs { means, quats, stillness, affinities, nodes, .. } = inputs;
    let device = means.device();
    let [places, precisions, poses] =
        [(0, 3), (3, 1), (4, 16)].map(|(first, count)| nodes.clone().narrow(1, first, count));
    let offsets = means.clone().detach().unsqueeze_dim::<3>(1) - places.unsqueeze_dim::<3>(0);
    let squared = offsets.powi_scalar(2).sum_dim(2).squeeze_dim::<2>(2);
    let mut logits = -squared * precisions.transpose();
    if let Some(affinities) = affinities {
        let columns = affinities.dims()[1];
        logits = logits + affinities.matmul(nodes.narrow(1, 20, columns).transpose());
    }
    let weights = softmax(Tensor::cat(vec![logits, stillness], 1), 1);
    let still = Tensor::<1>::from_floats(STILL.map(|value| value as f32), &device).unsqueeze::<2>();
    let pose = weights.matmul(Tensor::cat(vec![poses, still], 0));
    let [p, m, q] = [pose.split(1, 1), means.split(1, 1), quats.split(1, 1)];
    let position = |row: usize| {
        let turned = p[3 * row].clone() * m[0].clone() + p[3 * row + 1].clone() * m[1].clone();
        turned + p[3 * row + 2].clone() * m[2].clone() + p[9 + row].clone()
    };
    let term = |a: usize, b: usize| p[12 + a].clone() * q[b].clone();
    Tensor::cat(
        vec![
            position(0),
            position(1),
            position(2),
            term(0, 0) - term(1, 1) - term(2, 2) - term(3, 3),
            term(0, 1) + term(1, 0) + term(2, 3) - term(3, 2),
            term(0, 2) - term(1, 3) + term(2, 0) + term(3, 1),
            term(0, 3) + term(1, 2) - term(2, 1) + term(3, 0),
        ],
        1,
    )
}

/// Inputs whose gradients go through logits: stillness and affinities, anchors, precisions.
const BY_LOGITS: std::ops::Range<usize> = 2..5;

/// One Gaussian, one node; groups, chunks and slices that are not full; more chunks than tasks.
const SIZES: [[usize; 2]; 7] = [[1, 1], [7, 1], [8, 512], [300, 5], [259, 130], [1000, 32], [20_000, 3]];

fn cases() -> impl Iterator<Item = (String, Case, Vec<f64>)> {
    SIZES.into_iter().enumerate().flat_map(|(seed, [count, nodes])| {
        [0, 1, 2, 3, 4].map(|affinities| {
            let mut random = Random::new(300 + seed as u64);
            let case = Case::random(count, nodes, affinities, &mut random);
            let what = format!("{count} Gaussians, {nodes} nodes, {affinities} affinities");
            (what, case, loss_weights(count, &mut random))
        })
    })
}

/// The gradient by a logit is a weight times a difference of two terms; one of them is the inner product of the output
/// with its weights in the loss. The rounding of such a difference in float32 has the size of its terms, and for a
/// single Gaussian it may be all that is left.
#[track_caller]
fn assert_alike(what: &str, found: &(Vec<f32>, [Vec<f32>; 6]), expected: &(Vec<f32>, [Vec<f32>; 6]), weights: &[f64]) {
    assert_close_relative(&format!("{what}: output"), &found.0, &expected.0, 3e-6);
    let term = |(output, weights): (&[f32], &[f64])| -> f32 {
        output.iter().zip(weights).map(|(output, weight)| (output * *weight as f32).abs()).sum()
    };
    let terms = expected.0.chunks(7).zip(weights.chunks(7)).map(term).fold(0.0, f32::max);
    for (k, input) in INPUTS.iter().enumerate() {
        let what = format!("{what}: gradient of {input}");
        let largest = expected.1[k].iter().fold(0.0f32, |most, value| most.max(value.abs()));
        let rounding = if BY_LOGITS.contains(&k) { f32::EPSILON * terms } else { 0.0 };
        assert_close(&what, &found.1[k], &expected.1[k], f32::max(2e-5 * largest, rounding));
    }
}

/// Positions and quaternions, `[N, 7]`.
fn skinned(inputs: SkinningInputs) -> Tensor<2> {
    let Moved { means, quats } = skin(inputs);
    Tensor::cat(vec![means, quats], 1)
}

#[test]
fn values_and_gradients_are_those_of_plain_operations() {
    for (what, case, weights) in cases() {
        let expected = case.run(&Device::flex(), &weights, plain);
        for (name, device) in devices() {
            assert_alike(&format!("{name}, {what}"), &case.run(&device, &weights, skinned), &expected, &weights);
        }
    }
}

/// Gaussians so far from all nodes, or so near to one, that float32 knows one weight only; the node that stands still never
/// counts, always counts, or counts as much as a node.
#[test]
fn where_all_weights_but_one_are_lost() {
    let mut random = Random::new(310);
    for (place, precision) in [(1.0, 4000.0), (100.0, 1.0), (3000.0, 5.0)] {
        for stillness in [-1e9, 1e4] {
            let mut case = Case::random(60, 9, 0, &mut random);
            case.inputs[0].iter_mut().for_each(|value| *value = f64::from((*value * place) as f32));
            case.inputs[2].fill(stillness);
            case.inputs[4].fill(precision);
            let weights = loss_weights(60, &mut random);
            let what = format!("at {place}, precision {precision}, stillness {stillness}");
            // Where all exponents are 1e8, rounding decides in float32 which node is the nearest: there the results
            // only have to be finite.
            let expected = case.run(&Device::flex(), &weights, plain);
            for (name, device) in devices() {
                let found = case.run(&device, &weights, skinned);
                let all = found.1.iter().flatten().chain(&found.0);
                assert!(all.into_iter().all(|value| value.is_finite()), "{name}, {what}");
                if place < 1000.0 || stillness > 0.0 {
                    assert_alike_when_far(&format!("{name}, {what}"), &found, &expected);
                }
            }
        }
    }
}

/// An exponent of 1e4 has lost four digits before any kernel sees it.
#[track_caller]
fn assert_alike_when_far(what: &str, found: &(Vec<f32>, [Vec<f32>; 6]), expected: &(Vec<f32>, [Vec<f32>; 6])) {
    assert_close_relative(&format!("{what}: output"), &found.0, &expected.0, 2e-3);
    for (k, input) in INPUTS.iter().enumerate() {
        assert_close_relative(&format!("{what}: gradient of {input}"), &found.1[k], &expected.1[k], 2e-3);
    }
}

/// Every coordinate of every input. The twin's weights stay where they are when a mean moves.
#[test]
fn gradients_against_differences_of_the_twin() {
    const STEP: f64 = 1e-6;
    for (seed, [count, nodes, affinities]) in
        [[5, 1, 0], [11, 3, 0], [9, 6, 0], [9, 6, 2], [10, 5, 4]].into_iter().enumerate()
    {
        let mut random = Random::new(320 + seed as u64);
        let case = Case::random(count, nodes, affinities, &mut random);
        let weights = loss_weights(count, &mut random);
        let weighed = &case.inputs[0];
        let loss = |case: &Case| -> f64 {
            case.twin(weighed).iter().zip(&weights).map(|(value, weight)| value * weight).sum()
        };
        let output: Vec<f32> = case.twin(weighed).into_iter().map(|value| value as f32).collect();
        let gradients = std::array::from_fn(|k| {
            let along = |i: usize| {
                let at = |step: f64| {
                    let mut moved = case.clone();
                    moved.inputs[k][i] += step;
                    loss(&moved)
                };
                ((at(STEP) - at(-STEP)) / (2.0 * STEP)) as f32
            };
            (0..case.inputs[k].len()).map(along).collect()
        });
        let expected = (output, gradients);
        for (name, device) in devices() {
            let what = format!("{name}, {count} Gaussians, {nodes} nodes");
            assert_alike(&what, &case.run(&device, &weights, skinned), &expected, &weights);
        }
    }
}

/// And the back ends of the processor share their kernels.
#[test]
fn the_number_of_threads_changes_no_bit() {
    let pool = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let pools = [pool(1), pool(2), pool(5)];
    let bits = |(output, gradients): (Vec<f32>, [Vec<f32>; 6])| {
        gradients.into_iter().flatten().chain(output).map(f32::to_bits).collect::<Vec<_>>()
    };
    for (what, case, weights) in cases() {
        let run = |device: &Device| bits(case.run(device, &weights, skinned));
        let expected = pools[0].install(|| run(&Device::flex()));
        for (name, device) in cpu_devices() {
            for pool in &pools {
                assert!(pool.install(|| run(&device)) == expected, "{name}, {what}");
            }
        }
    }
}

/// A graphics driver rounds in its own way, but always the same.
#[test]
fn a_second_run_gives_the_same_bits() {
    let (what, case, weights) = cases().last().expect("there are cases");
    for (name, device) in devices() {
        let runs = [(); 2].map(|()| case.run(&device, &weights, skinned));
        assert!(runs[0] == runs[1], "{name}, {what}");
    }
}

/// Inputs that are no leaves: columns of larger tensors, transposed ones.
#[test]
fn tensors_may_lie_in_memory_as_they_like() {
    let mut random = Random::new(330);
    let case = Case::random(50, 6, 2, &mut random);
    let weights = loss_weights(50, &mut random);
    for (name, device) in devices() {
        let expected = case.run(&device, &weights, skinned);
        let found = case.run(&device, &weights, |inputs| {
            let SkinningInputs { means, quats, stillness, affinities, nodes, .. } = inputs;
            let affinities = affinities.expect("this case has them");
            let gaussians = Tensor::cat(vec![stillness, affinities, means, quats], 1);
            let nodes = Tensor::cat(vec![nodes.clone().transpose(), nodes.transpose()], 0);
            let columns = |first, count| gaussians.clone().narrow(1, first, count);
            let nodes = nodes.narrow(0, 22, 22).transpose();
            let inputs = SkinningInputs::new(columns(3, 3), columns(6, 4), columns(0, 1), nodes);
            skinned(SkinningInputs { affinities: Some(columns(1, 2)), ..inputs })
        });
        assert!(found == expected, "{name}");
    }
}

#[test]
fn no_gaussian_is_no_error() {
    let case = Case::random(0, 3, 0, &mut Random::new(350));
    for (name, device) in devices() {
        let (found, gradients) = case.run(&device, &[], skinned);
        assert!(found.is_empty(), "{name}");
        assert!(gradients.iter().flatten().all(|value| *value == 0.0), "{name}");
        assert_eq!(gradients.map(|values| values.len()), [0, 0, 0, 9, 3, 48], "{name}");
    }
}

#[test]
#[should_panic(expected = "stillness must be [N, 1]")]
fn a_wrong_shape_is_named() {
    let mut case = Case::random(5, 3, 0, &mut Random::new(340));
    case.inputs[2].push(1.0);
    case.run(&Device::flex(), &[0.0; 35], skinned);
}
