//! Rigid motion in your own crate: a few control nodes that move on splines, and Gaussians that follow the nodes around
//! them (linear blend skinning). Trained, stopped and resumed, coded, decoded. No file of Light4GS is edited.
//!
//! This field uses more of the interface than the paper's: whole Gaussians and world positions (`deform`), nodes that
//! are made from the cloud when motion begins (`begin_motion`, `resize`), limits on the result of a step
//! (`begin_step`), its own loss (`regularizer`) and its own learning rates (`learning_rate`). The trainer gets a
//! sampler that shows the middle of the scene's time first. In the file, skinning is a list of operations that the
//! codec runs. The nodes' poses depend on the time alone, so the codec computes them once per frame.

use std::collections::BTreeMap;

use burn::config::Config;
use burn::module::{Module, Param};
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Int, Tensor, TensorData, s};
use light4gs::codec::network::{Layer, Operation, Value};
use light4gs::codec::{MotionArrays, MotionEvaluator, MotionNetwork, MotionOutput, MotionSource, Network, decode};
use light4gs::data::Scene;
use light4gs::model::{
    DeformationField, DynamicScene, FeaturePlanes, FinePosition, GaussianTensors, LearningRate, ModelError,
    SceneAtRest, ScenePoints,
};
use light4gs::train::Stage;
use light4gs::train::dataset::load_options;
use light4gs::train::run::RunFolder;
use light4gs::train::sampling::BatchRequest;
use light4gs::train::trainer::Trainer;
use light4gs_examples::{Outcome, first_and_last, tiny_config, tiny_scene};
use rand::Rng;

/// Configuration of [`RigidNodes`].
#[derive(Config, Debug)]
struct RigidNodesConfig {
    /// Nodes, or as many as there are Gaussians if those are fewer.
    #[config(default = 12)]
    nodes: usize,
    /// Knots of a node's spline, at least 4.
    #[config(default = 8)]
    knots: usize,
}

/// `B` nodes. The arrays are ordered by component: `[3, B]` has all x, then all y, then all z.
#[derive(Module, Debug)]
struct RigidNodes {
    /// Places, `[3, B]`, world units.
    anchors: Param<Tensor<2>>,
    /// `[1, B]`: logarithms of the radius in which a node has an effect, world units.
    log_radii: Param<Tensor<2>>,
    /// `[K, 3 B]`: translations of the nodes, world units.
    shifts: Param<Tensor<2>>,
    /// `[K, 4 B]`: rotations of the nodes, as quaternions minus the identity.
    turns: Param<Tensor<2>>,
    /// Largest number of nodes, once motion has begun.
    most: usize,
}

/// Products of the quaternion's components (w, x, y, z) from which a rotation matrix is made: xx yy zz, xy yz xz, wz wx
/// wy.
const FACTORS: [[usize; 9]; 2] = [[1, 2, 3, 1, 2, 1, 0, 0, 0], [1, 2, 3, 2, 3, 3, 3, 1, 2]];
/// The diagonal is 1 - 2 (a + b) of these products.
const DIAGONAL: [[usize; 3]; 2] = [[1, 0, 0], [2, 2, 1]];
/// The others are 2 (a - b) and 2 (a + b) of these.
const OTHERS: [[usize; 3]; 2] = [[3, 4, 5], [6, 7, 8]];
/// Positions of the nine elements, row by row, among diagonal, differences and sums.
const ELEMENTS: [usize; 9] = [0, 3, 8, 6, 1, 4, 5, 7, 2];
/// The matrix of multiplication by a quaternion from the left: its components; 4 to 7 are negative.
const PRODUCT: [usize; 16] = [0, 5, 6, 7, 1, 0, 7, 2, 2, 3, 0, 5, 3, 6, 1, 0];

/// Rows of a tensor by their numbers.
fn rows(tensor: &Tensor<2>, numbers: &[usize]) -> Tensor<2> {
    let numbers: Vec<i64> = numbers.iter().map(|number| *number as i64).collect();
    tensor.clone().select(0, Tensor::<1, Int>::from_data(TensorData::from(&numbers[..]), &tensor.device()))
}

/// Each row of `matrices [N, n n]` times the row of `vectors [N, n]`.
fn products(matrices: Tensor<2>, vectors: &Tensor<2>) -> Tensor<2> {
    let [count, n] = vectors.dims();
    (matrices.reshape([count, n, n]) * vectors.clone().reshape([count, 1, n])).sum_dim(2).reshape([count, n])
}

impl RigidNodes {
    fn zeros(nodes: usize, knots: usize, most: usize, device: &Device) -> Self {
        let zeros = |shape: [usize; 2]| Param::from_tensor(Tensor::zeros(shape, device));
        Self {
            anchors: zeros([3, nodes]),
            log_radii: zeros([1, nodes]),
            shifts: zeros([knots, 3 * nodes]),
            turns: zeros([knots, 4 * nodes]),
            most,
        }
    }

    fn nodes(&self) -> usize {
        self.anchors.dims()[1]
    }

    fn knots(&self) -> usize {
        self.shifts.dims()[0]
    }

    /// `[1, K]`: the weight of each knot at a time, the uniform cubic B-spline at the knot's distance.
    fn basis(&self, time: f32) -> Tensor<2> {
        let weight = |knot: usize| {
            let distance = (time * (self.knots() - 3) as f32 + 1.0 - knot as f32).abs();
            let [outer, inner] = [2.0, 1.0].map(|end: f32| (end - distance).max(0.0).powi(3) / 6.0);
            outer - 4.0 * inner
        };
        let weights: Vec<f32> = (0..self.knots()).map(weight).collect();
        Tensor::from_data(TensorData::new(weights, [1, self.knots()]), &self.shifts.device())
    }

    /// `[16, B]` at a time: the rotation matrix row by row, the vector that is added to a rotated point, the rotation
    /// as a quaternion.
    fn poses(&self, time: f32) -> Tensor<2> {
        let (basis, nodes) = (self.basis(time), self.nodes());
        let shift = basis.clone().matmul(self.shifts.val()).reshape([3, nodes]);
        let one = Tensor::from_floats([[1.0], [0.0], [0.0], [0.0]], &shift.device());
        let turn = basis.matmul(self.turns.val()).reshape([4, nodes]) + one;
        let turn = turn.clone() / turn.powi_scalar(2).sum_dim(0).sqrt();
        let terms = rows(&turn, &FACTORS[0]) * rows(&turn, &FACTORS[1]);
        let [first, second] = OTHERS.map(|numbers| rows(&terms, &numbers));
        let diagonal = (rows(&terms, &DIAGONAL[0]) + rows(&terms, &DIAGONAL[1])) * -2.0 + 1.0;
        let others = [(first.clone() - second.clone()) * 2.0, (first + second) * 2.0];
        let matrix = rows(&Tensor::cat([vec![diagonal], others.to_vec()].concat(), 0), &ELEMENTS);
        let anchors = self.anchors.val();
        let turned = (matrix.clone().reshape([3, 3, nodes]) * anchors.clone().reshape([1, 3, nodes])).sum_dim(1);
        let offset = anchors + shift - turned.reshape([3, nodes]);
        Tensor::cat(vec![matrix, offset, turn], 0)
    }

    /// `[N, B]`: the weight of each node for each Gaussian.
    fn weights(&self, means: &Tensor<2>) -> Tensor<2> {
        let offset = means.clone().unsqueeze_dim::<3>(2) - self.anchors.val().unsqueeze_dim::<3>(0);
        let square = offset.powi_scalar(2).sum_dim(1).reshape([means.dims()[0], self.nodes()]);
        softmax(square * (self.log_radii.val() * -2.0).exp() * -0.5, 1)
    }

    /// Channel numbers of the given blocks, each of `B` channels.
    fn channels(&self, blocks: &[usize]) -> Vec<u32> {
        let nodes = self.nodes();
        blocks.iter().flat_map(|block| (block * nodes..(block + 1) * nodes).map(|channel| channel as u32)).collect()
    }

    /// [`Self::poses`] for the codec, as `[16 B]`.
    fn describe_poses(&self, network: &mut Network, time: Value, anchors: Value) -> Value {
        let affine = |scale, offset| Operation::Affine { scale, offset };
        let distances: Vec<Value> = (0..self.knots())
            .map(|knot| network.node(affine((self.knots() - 3) as f32, 1.0 - knot as f32), &[time]))
            .collect();
        let distances = network.node(Operation::Concatenate, &distances);
        let square = network.node(Operation::Multiply, &[distances, distances]);
        let distances = network.node(Operation::SquareRoot, &[square]);
        let [outer, inner] = [(2.0, 1.0 / 6.0), (1.0, 4.0 / 6.0)].map(|(end, factor)| {
            let rest = network.node(affine(-1.0, end), &[distances]);
            let rest = network.relu(rest);
            let square = network.node(Operation::Multiply, &[rest, rest]);
            let cube = network.node(Operation::Multiply, &[square, rest]);
            network.node(affine(factor, 0.0), &[cube])
        });
        let basis = network.node(Operation::Subtract, &[outer, inner]);
        let shift = network.layer(basis, spline_layer(&self.shifts.val()));
        let turn = network.layer(basis, spline_layer(&self.turns.val()));

        let pick = |network: &mut Network, value, blocks: &[usize]| {
            network.node(Operation::Select(self.channels(blocks)), &[value])
        };
        let real = pick(network, turn, &[0]);
        let real = network.node(affine(1.0, 1.0), &[real]);
        let imaginary = pick(network, turn, &[1, 2, 3]);
        let turn = network.node(Operation::Concatenate, &[real, imaginary]);
        let square = network.node(Operation::Multiply, &[turn, turn]);
        let length = self.describe_sum(network, square, &[[0], [1], [2], [3]]);
        let length = network.node(Operation::SquareRoot, &[length]);
        let turn = network.node(Operation::Divide, &[turn, length]);
        let factors = FACTORS.map(|blocks| pick(network, turn, &blocks));
        let terms = network.node(Operation::Multiply, &factors);
        let others = OTHERS.map(|blocks| pick(network, terms, &blocks));
        let diagonal = DIAGONAL.map(|blocks| pick(network, terms, &blocks));
        let diagonal = network.node(Operation::Add, &diagonal);
        let difference = network.node(Operation::Subtract, &others);
        let sum = network.node(Operation::Add, &others);
        let parts = [(diagonal, -2.0, 1.0), (difference, 2.0, 0.0), (sum, 2.0, 0.0)];
        let parts = parts.map(|(part, scale, offset)| network.node(affine(scale, offset), &[part]));
        let parts = network.node(Operation::Concatenate, &parts);
        let matrix = pick(network, parts, &ELEMENTS);
        let turned = network.node(Operation::Multiply, &[matrix, anchors]);
        let turned = self.describe_sum(network, turned, &[[0, 3, 6], [1, 4, 7], [2, 5, 8]]);
        let offset = network.node(Operation::Add, &[anchors, shift]);
        let offset = network.node(Operation::Subtract, &[offset, turned]);
        network.node(Operation::Concatenate, &[matrix, offset, turn])
    }

    /// The sum of some blocks.
    fn describe_sum<const N: usize>(&self, network: &mut Network, value: Value, terms: &[[usize; N]]) -> Value {
        let mut pick = |blocks: &[usize; N]| network.node(Operation::Select(self.channels(blocks)), &[value]);
        let picked: Vec<Value> = terms.iter().map(&mut pick).collect();
        picked.into_iter().reduce(|sum, term| network.node(Operation::Add, &[sum, term])).expect("a sum has terms")
    }

    /// [`Self::weights`] for the codec, as `[B]`.
    fn describe_weights(&self, network: &mut Network, time: Value, means: Value, anchors: Value) -> Value {
        let nodes = self.nodes() as u32;
        let affine = |scale| Operation::Affine { scale, offset: 0.0 };
        let repeated = (0..3).flat_map(|axis| vec![axis; nodes as usize]).collect();
        let means = network.node(Operation::Select(repeated), &[means]);
        let offset = network.node(Operation::Subtract, &[means, anchors]);
        let square = network.node(Operation::Multiply, &[offset, offset]);
        let square = self.describe_sum(network, square, &[[0], [1], [2]]);
        let log_radii = network.constant(time, 1, numbers(self.log_radii.val()));
        let inverse = network.node(affine(-2.0), &[log_radii]);
        let inverse = network.node(Operation::Exponential, &[inverse]);
        let exponent = network.node(Operation::Multiply, &[square, inverse]);
        let exponent = network.node(affine(-0.5), &[exponent]);
        let largest = network.node(Operation::GroupMaximum(nodes), &[exponent]);
        let exponent = network.node(Operation::Subtract, &[exponent, largest]);
        let weights = network.node(Operation::Exponential, &[exponent]);
        let sum = network.node(Operation::GroupSum(nodes), &[weights]);
        network.node(Operation::Divide, &[weights, sum])
    }
}

/// The numbers of a tensor, row by row.
fn numbers(tensor: Tensor<2>) -> Vec<f32> {
    tensor.into_data().iter().collect()
}

/// From the weights `[K]` of the knots and their values `[K, C]` to the value at the time.
fn spline_layer(knots: &Tensor<2>) -> Layer {
    Layer::linear(numbers(knots.clone().transpose()), vec![0.0; knots.dims()[1]])
}

/// Chooses points that are far from each other: the first is the nearest to the middle, and each next one the farthest
/// from those before.
fn spread_out(points: &[[f32; 3]], count: usize) -> Vec<[f32; 3]> {
    let square = |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
    let middle = std::array::from_fn(|axis| points.iter().map(|point| point[axis]).sum::<f32>() / points.len() as f32);
    let mut chosen: Vec<[f32; 3]> =
        points.iter().min_by(|a, b| square(a, &middle).total_cmp(&square(b, &middle))).copied().into_iter().collect();
    while chosen.len() < count.min(points.len()) {
        let nearest = |point: &[f32; 3]| chosen.iter().map(|other| square(point, other)).fold(f32::INFINITY, f32::min);
        chosen.extend(points.iter().max_by(|a, b| nearest(a).total_cmp(&nearest(b))).copied());
    }
    chosen
}

impl DeformationField for RigidNodes {
    type Config = RigidNodesConfig;

    const KINDS: &'static [&'static str] = &["rigid-nodes"];

    /// One node, until there is a cloud from which the nodes can be made.
    fn init(config: &RigidNodesConfig, device: &Device) -> Self {
        Self::zeros(1, config.knots, config.nodes, device)
    }

    fn deform(&self, canonical: GaussianTensors, _: ScenePoints<'_>, time: f32) -> GaussianTensors {
        let blended = self.weights(&canonical.means).matmul(self.poses(time).transpose());
        let means =
            products(blended.clone().slice(s![.., 0..9]), &canonical.means) + blended.clone().slice(s![.., 9..12]);
        let turn = blended.slice(s![.., 12..16]).transpose();
        let product = rows(&Tensor::cat(vec![turn.clone(), -turn], 0), &PRODUCT).transpose();
        // Quaternions may have any length.
        GaussianTensors { means, quats: products(product, &canonical.quats), ..canonical }
    }

    fn begin_motion(&mut self, scene: &SceneAtRest<'_>, _: &FinePosition) {
        let device = self.anchors.device();
        let means = numbers(scene.gaussians.means.val());
        let anchors = spread_out(means.as_chunks().0, self.most);
        *self = Self::zeros(anchors.len(), self.knots(), self.most, &device);
        let columns = Tensor::<2>::from_data(TensorData::new(anchors.concat(), [anchors.len(), 3]), &device);
        // Half the side of each node's cube, if the nodes' box were divided into one cube for each node.
        let extent = columns.clone().max_dim(0) - columns.clone().min_dim(0);
        let radius = 0.5 * extent.max().into_scalar::<f32>().max(1e-3) / (anchors.len() as f32).cbrt();
        self.anchors = Param::from_tensor(Tensor::from_data(columns.transpose().into_data(), &device));
        self.log_radii = Param::from_tensor(Tensor::full([1, anchors.len()], radius.ln(), &device));
    }

    /// No node reaches farther than the scene, and none has a radius so small that it loses its neighborhood.
    fn begin_step(&mut self, scene: &SceneAtRest<'_>, _: &FinePosition) {
        let (least, most) = ((0.01 * scene.extent).ln(), scene.extent.ln());
        self.log_radii = Param::from_tensor(self.log_radii.val().clamp(least, most).detach());
    }

    /// Trajectories are smooth at the start and may become less so.
    fn regularizer(&self, scene: &SceneAtRest<'_>, position: &FinePosition) -> Option<Tensor<1>> {
        let last = self.knots();
        let bend = |knots: Tensor<2>| {
            let part = |first: usize, end: usize| knots.clone().slice(s![first..end, ..]);
            (part(0, last - 2) - part(1, last - 1) * 2.0 + part(2, last)).powi_scalar(2).mean()
        };
        let weight = 1.0 - position.iteration as f32 / position.iterations as f32;
        Some((bend(self.shifts.val() / scene.extent) + bend(self.turns.val())) * weight)
    }

    /// Trajectories are learned faster than the nodes' places.
    fn learning_rate(&self, path: &str, usual: LearningRate) -> LearningRate {
        if ["shifts", "turns"].contains(&path) { usual.times(10.0) } else { usual }
    }

    /// As many nodes as the checkpoint has.
    fn resize(&mut self, shapes: &BTreeMap<String, Vec<usize>>) -> Result<(), ModelError> {
        let nodes = shapes.get("anchors").and_then(|shape| shape.last().copied()).unwrap_or(0);
        if !(1..=self.most).contains(&nodes) {
            return Err(ModelError::Motion(format!("{nodes} nodes, expected 1 to {}", self.most)));
        }
        *self = Self::zeros(nodes, self.knots(), self.most, &self.anchors.device());
        Ok(())
    }

    fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
        let (mut network, [time, means, quats]) = Network::new([1, 3, 4]);
        let anchors = network.constant(time, 1, numbers(self.anchors.val()));
        let poses = self.describe_poses(&mut network, time, anchors);
        let weights = self.describe_weights(&mut network, time, means, anchors);
        let blended = network.node(Operation::Multiply, &[poses, weights]);
        let blended = network.node(Operation::GroupSum(self.nodes() as u32), &[blended]);
        let part = |network: &mut Network, channels: std::ops::Range<u32>| {
            network.node(Operation::Select(channels.collect()), &[blended])
        };
        let matrix = part(&mut network, 0..9);
        let moved = network.node(Operation::Multiply, &[matrix, means]);
        let moved = network.node(Operation::GroupSum(3), &[moved]);
        let offset = part(&mut network, 9..12);
        let position = network.node(Operation::Add, &[moved, offset]);
        network.output(position);
        let turn = part(&mut network, 12..16);
        let negative = network.node(Operation::Affine { scale: -1.0, offset: 0.0 }, &[turn]);
        let both = network.node(Operation::Concatenate, &[turn, negative]);
        let product = network.node(Operation::Select(PRODUCT.map(|channel| channel as u32).to_vec()), &[both]);
        let turned = network.node(Operation::Multiply, &[product, quats]);
        let quaternion = network.node(Operation::GroupSum(4), &[turned]);
        network.output(quaternion);
        let attribute = |name: &str| MotionSource::Attribute(name.to_owned());
        let sources = vec![MotionSource::Time, attribute("means"), attribute("quats")];
        let outputs = vec![MotionOutput::NewPosition, MotionOutput::NewQuaternion];
        let network = MotionNetwork { network, sources, outputs };
        Ok(MotionArrays { kind: self.kind().to_owned(), network: Some(network), tensors: Vec::new() })
    }

    fn from_arrays(arrays: &MotionArrays, _planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
        let wrong = || ModelError::Motion("the network is not that of rigid nodes".to_owned());
        let layers: Vec<&Layer> = arrays.network.iter().flat_map(|motion| motion.network.layers()).collect();
        let &[anchors, shifts, turns, log_radii] = layers.as_slice() else { return Err(wrong()) };
        let (nodes, knots) = (log_radii.outputs as usize, shifts.inputs as usize);
        // A file may come from anybody, so its sizes are checked first.
        let is = |layer: &Layer, outputs: usize| {
            layer.outputs as usize == outputs && layer.weight.len() == outputs * layer.inputs as usize
        };
        let fits = is(anchors, 3 * nodes) && is(shifts, 3 * nodes) && is(turns, 4 * nodes) && is(log_radii, nodes);
        if !fits || turns.inputs != shifts.inputs || knots < 4 {
            return Err(wrong());
        }
        let load =
            |values: &[f32], shape: [usize; 2]| Tensor::<2>::from_data(TensorData::new(values.to_vec(), shape), device);
        let spline = |layer: &Layer| {
            Tensor::from_data(load(&layer.weight, [layer.outputs as usize, knots]).transpose().into_data(), device)
        };
        let field = Self {
            anchors: Param::from_tensor(load(&anchors.bias, [3, nodes])),
            log_radii: Param::from_tensor(load(&log_radii.bias, [1, nodes])),
            shifts: Param::from_tensor(spline(shifts)),
            turns: Param::from_tensor(spline(turns)),
            most: nodes,
        };
        // Then everything is compared: the field made from these numbers must be what the file describes.
        if field.to_arrays()? == *arrays { Ok(field) } else { Err(wrong()) }
    }
}

/// Frames of the times around the middle first, and then of more and more times: a trajectory is extended from where it
/// is known.
fn widening_window(request: &BatchRequest) -> Vec<usize> {
    let times = &request.candidates.times;
    let share = match request.stage {
        Stage::Coarse => 0.25,
        Stage::Fine => (0.25 + 2.0 * request.iteration as f64 / request.iterations as f64).min(1.0),
    };
    let count = ((share * times.len() as f64).ceil() as usize).clamp(1, times.len());
    let seen = times[(times.len() - count) / 2..][..count].concat();
    let mut random = request.generator(request.iteration);
    (0..request.batch_size).map(|_| seen[random.random_range(0..seen.len())]).collect()
}

pub(crate) fn main() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut config = tiny_config()?;
    config.train.checkpoint_interval = 50;
    // The positions of nodes are weights of the network: they are stored with the highest precision.
    config.compression.weights.deformation_bits = 16;
    let root = tiny_scene(folder.path())?;
    let run = RunFolder::create(&folder.path().join("run"), Some(&root), &config, false)?;
    let builder = || -> Outcome<_> {
        let data = Scene::open(&root, &load_options(&config))?;
        let builder = Trainer::<RigidNodes>::builder_with_field(config.clone(), data, RigidNodesConfig::new());
        Ok(builder.sampler(widening_window).run_folder(run.clone()))
    };

    // Trained into the fine stage, where the nodes are made, and then dropped, as in a crash.
    let mut losses = Vec::new();
    let mut trainer = builder()?.build()?;
    for _ in 0..90 {
        losses.extend(trainer.step()?.map(|step| step.loss));
    }
    let nodes = trainer.scene().field.nodes();
    println!("{nodes} nodes");
    assert_eq!(nodes, 12);
    drop(trainer);

    // Resumed from the last checkpoint, which has the nodes.
    let mut trainer = builder()?.resume()?;
    assert_eq!((trainer.position().1, trainer.scene().field.nodes()), (50, nodes));
    losses.truncate(20 + 50);
    while let Some(step) = trainer.step()? {
        losses.push(step.loss);
    }
    let (first, last) = first_and_last(&losses);
    println!("loss: {first:.3} in the first tenth of the run, {last:.3} in the last");
    assert!(last < 0.7 * first);
    let moved = trainer.scene().at(0.9).means - trainer.scene().at(0.1).means;
    assert!(moved.abs().max().into_scalar::<f32>() > 1e-3, "nothing moves");

    // Coded, and decoded by the codec alone.
    let bytes = trainer.encode()?.bytes;
    println!("{} bytes", bytes.len());
    let arrays = decode(&bytes)?;
    assert_eq!(arrays.motion.kind, "rigid-nodes");
    let decoded = DynamicScene::<RigidNodes>::from_arrays(&arrays, &Device::flex())?;
    let evaluator = MotionEvaluator::new(&arrays)?;
    for time in [0.0, 0.3, 1.0] {
        let ours = decoded.at(time).to_arrays();
        let mut theirs = arrays.gaussians.clone();
        evaluator.apply(&arrays.gaussians, time, 0..theirs.len(), &mut theirs);
        let difference =
            |ours: &[f32], theirs: &[f32]| ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let means = difference(ours.means.as_flattened(), theirs.means.as_flattened());
        let quats = difference(ours.quats.as_flattened(), theirs.quats.as_flattened());
        println!("at {time}: Burn and the codec differ by {means:e} in positions and {quats:e} in quaternions");
        assert!(means < 1e-4 && quats < 1e-4);
    }
    Ok(())
}
