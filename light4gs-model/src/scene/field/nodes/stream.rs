//! The same as operations of the codec: skinning and splines in a file, which any program evaluates bit for bit.
//!
//! Poses depend on the time alone, so the codec computes them once a frame. Values of all nodes stand by component: a pose is 16
//! blocks of `B` channels.

use burn::module::Param;
use burn::tensor::{Device, Tensor};
use light4gs_codec::network::{Layer, Operation, Value};
use light4gs_codec::{MotionArrays, MotionNetwork, MotionOutput, MotionSource, Network};

use super::trajectory::{DIAGONAL, ELEMENTS, FACTORS, OTHERS};
use super::{
    AFFINITY, LIFETIME, MOST_AFFINITIES, MOST_KNOTS, MOST_NODES, NodesField, NodesFieldConfig, STILLNESS, lifetime,
    numbers, tensor,
};
use crate::scene::ModelError;
use crate::scene::field::DeformationField;

/// The matrix of a product from the left with a quaternion: its components, 4 to 7 negative.
const PRODUCT: [usize; 16] = [0, 5, 6, 7, 1, 0, 7, 2, 2, 3, 0, 5, 3, 6, 1, 0];
/// A pose that moves nothing.
const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

pub(super) fn affine(scale: f32, offset: f32) -> Operation {
    Operation::Affine { scale, offset }
}

/// A network in which many values have a block of channels for each component, one channel a node.
struct Description {
    network: Network,
    nodes: usize,
}

impl Description {
    fn node(&mut self, operation: Operation, inputs: &[Value]) -> Value {
        self.network.node(operation, inputs)
    }

    /// Some blocks of a value.
    fn blocks(&mut self, value: Value, blocks: &[usize]) -> Value {
        let channels = |block: &usize| (block * self.nodes) as u32..((block + 1) * self.nodes) as u32;
        let channels = blocks.iter().flat_map(channels).collect();
        self.node(Operation::Select(channels), &[value])
    }

    /// The sum of some lists of blocks.
    fn block_sum<const N: usize>(&mut self, value: Value, terms: &[[usize; N]]) -> Value {
        let picked: Vec<Value> = terms.iter().map(|blocks| self.blocks(value, blocks)).collect();
        picked.into_iter().reduce(|sum, term| self.node(Operation::Add, &[sum, term])).expect("a sum has terms")
    }

    /// Some channels of a value.
    fn channels(&mut self, value: Value, channels: impl IntoIterator<Item = usize>) -> Value {
        let channels = channels.into_iter().map(|channel| channel as u32).collect();
        self.node(Operation::Select(channels), &[value])
    }

    /// So many channels that count up from a number. They double from step to step: a network has few nodes.
    fn count_from(&mut self, first: f32, any: Value, count: usize) -> Value {
        let mut numbers = self.node(affine(0.0, first), &[any]);
        let mut so_far = 1;
        while so_far < count {
            let next = self.node(affine(1.0, so_far as f32), &[numbers]);
            numbers = self.node(Operation::Concatenate, &[numbers, next]);
            so_far *= 2;
        }
        self.channels(numbers, 0..count)
    }

    /// How much each knot counts: from `|t - knot|` in knots, the difference of two truncated cubes.
    fn basis(&mut self, time: Value, knots: usize) -> Value {
        let time = self.node(affine((knots - 3) as f32, 0.0), &[time]);
        let times = self.channels(time, vec![0; knots]);
        let places = self.count_from(-1.0, time, knots);
        let distances = self.node(Operation::Subtract, &[times, places]);
        let square = self.node(Operation::Multiply, &[distances, distances]);
        let distances = self.node(Operation::SquareRoot, &[square]);
        let [outer, inner] = [(2.0, 1.0 / 6.0), (1.0, 4.0 / 6.0)].map(|(end, factor)| {
            let rest = self.node(affine(-1.0, end), &[distances]);
            let rest = self.network.relu(rest);
            let square = self.node(Operation::Multiply, &[rest, rest]);
            let cube = self.node(Operation::Multiply, &[square, rest]);
            self.node(affine(factor, 0.0), &[cube])
        });
        self.node(Operation::Subtract, &[outer, inner])
    }

    /// Rotation matrices, offsets and quaternions, 16 blocks, from the layers of the knots.
    fn poses(&mut self, basis: Value, anchors: Value, translations: Layer, rotations: Layer) -> Value {
        let translation = self.network.layer(basis, translations);
        let turn = self.network.layer(basis, rotations);
        let real = self.blocks(turn, &[0]);
        let real = self.node(affine(1.0, 1.0), &[real]);
        let imaginary = self.blocks(turn, &[1, 2, 3]);
        let turn = self.node(Operation::Concatenate, &[real, imaginary]);
        let square = self.node(Operation::Multiply, &[turn, turn]);
        let length = self.block_sum(square, &[[0], [1], [2], [3]]);
        let length = self.node(Operation::SquareRoot, &[length]);
        let turn = self.node(Operation::Divide, &[turn, length]);

        let factors = FACTORS.map(|blocks| self.blocks(turn, &blocks));
        let terms = self.node(Operation::Multiply, &factors);
        let others = OTHERS.map(|blocks| self.blocks(terms, &blocks));
        let diagonal = DIAGONAL.map(|blocks| self.blocks(terms, &blocks));
        let diagonal = self.node(Operation::Add, &diagonal);
        let difference = self.node(Operation::Subtract, &others);
        let sum = self.node(Operation::Add, &others);
        let parts = [(diagonal, -2.0, 1.0), (difference, 2.0, 0.0), (sum, 2.0, 0.0)];
        let parts = parts.map(|(part, scale, offset)| self.node(affine(scale, offset), &[part]));
        let parts = self.node(Operation::Concatenate, &parts);
        let matrix = self.blocks(parts, &ELEMENTS);
        let turned = self.node(Operation::Multiply, &[matrix, anchors]);
        let turned = self.block_sum(turned, &[[0, 3, 6], [1, 4, 7], [2, 5, 8]]);
        let offset = self.node(Operation::Add, &[anchors, translation]);
        let offset = self.node(Operation::Subtract, &[offset, turned]);
        self.node(Operation::Concatenate, &[matrix, offset, turn])
    }

    /// The logits of the nodes at a Gaussian: `-|mu - a|² / (2 r²)`.
    fn logits(&mut self, means: Value, anchors: Value, log_radii: Value) -> Value {
        let inverse = self.node(affine(-2.0, 0.0), &[log_radii]);
        let inverse = self.node(Operation::Exponential, &[inverse]);
        let repeated: Vec<usize> = (0..3).flat_map(|axis| vec![axis; self.nodes]).collect();
        let means = self.channels(means, repeated);
        let offset = self.node(Operation::Subtract, &[means, anchors]);
        let square = self.node(Operation::Multiply, &[offset, offset]);
        let square = self.block_sum(square, &[[0], [1], [2]]);
        let logits = self.node(Operation::Multiply, &[square, inverse]);
        self.node(affine(-0.5, 0.0), &[logits])
    }

    /// Behind each block of the poses, that of a node which never moves.
    fn with_identity(&mut self, poses: Value) -> Value {
        let any = self.channels(poses, [0]);
        let zero = self.node(affine(0.0, 0.0), &[any]);
        let one = self.node(affine(1.0, 1.0), &[zero]);
        let all = self.node(Operation::Concatenate, &[poses, zero, one]);
        let nodes = self.nodes;
        let channels = IDENTITY.iter().enumerate().flat_map(|(block, value)| {
            let still = IDENTITY.len() * nodes + *value as usize;
            (block * nodes..(block + 1) * nodes).chain([still])
        });
        self.channels(all, channels)
    }

    /// The blended pose, 16 channels.
    fn blended(&mut self, poses: Value, logits: Value, count: usize) -> Value {
        let count = count as u32;
        let largest = self.node(Operation::GroupMaximum(count), &[logits]);
        let exponents = self.node(Operation::Subtract, &[logits, largest]);
        let weights = self.node(Operation::Exponential, &[exponents]);
        let sum = self.node(Operation::GroupSum(count), &[weights]);
        let weights = self.node(Operation::Divide, &[weights, sum]);
        let blended = self.node(Operation::Multiply, &[poses, weights]);
        self.node(Operation::GroupSum(count), &[blended])
    }
}

impl NodesField {
    pub(super) fn describe(&self) -> MotionArrays {
        let nodes = self.nodes();
        let still = self.config.stillness;
        let (mut network, [time, means, quats]) = Network::new([1, 3, 4]);
        let mut sources = vec![MotionSource::Time, source("means"), source("quats")];
        // Further inputs, behind these.
        let mut input = |name: &str, width: u32| {
            network.inputs.push(width);
            sources.push(source(name));
            Value(network.inputs.len() as u32 - 1)
        };
        let stillness = still.then(|| input(STILLNESS, 1));
        let affinity = self.affinities.as_ref().map(|all| (all, input(AFFINITY, all.dims()[1] as u32)));
        let lifetime = self.config.lifetime.then(|| [input("opacity_logits", 1), input(LIFETIME, 2)]);
        let mut description = Description { network, nodes };
        let anchors = numbers(self.world_anchors().transpose());
        let anchors = description.network.constant(time, 1, anchors);
        let basis = description.basis(time, self.knots());
        let unit = self.unit.val().unsqueeze();
        let translations = by_component(self.translations.val() * unit, nodes);
        let poses = description.poses(basis, anchors, translations, by_component(self.rotations.val(), nodes));
        let log_radii = self.log_radii.val() + self.unit.val().log().unsqueeze();
        let log_radii = description.network.constant(time, 1, numbers(log_radii));
        let mut logits = description.logits(means, anchors, log_radii);
        if let Some((affinities, affinity)) = affinity {
            let layer = Layer::linear(numbers(affinities.val()), vec![0.0; nodes]);
            let liking = description.network.layer(affinity, layer);
            logits = description.node(Operation::Add, &[logits, liking]);
        }
        let mut all = poses;
        if let Some(stillness) = stillness {
            all = description.with_identity(poses);
            logits = description.node(Operation::Concatenate, &[logits, stillness]);
        }
        let blended = description.blended(all, logits, nodes + usize::from(still));

        let matrix = description.channels(blended, 0..9);
        let moved = description.node(Operation::Multiply, &[matrix, means]);
        let moved = description.node(Operation::GroupSum(3), &[moved]);
        let offset = description.channels(blended, 9..12);
        let position = description.node(Operation::Add, &[moved, offset]);
        let turn = description.channels(blended, 12..16);
        let negative = description.node(affine(-1.0, 0.0), &[turn]);
        let both = description.node(Operation::Concatenate, &[turn, negative]);
        let product = description.channels(both, PRODUCT);
        let turned = description.node(Operation::Multiply, &[product, quats]);
        let quaternion = description.node(Operation::GroupSum(4), &[turned]);
        let mut network = description.network;
        network.output(position);
        network.output(quaternion);
        let mut outputs = vec![MotionOutput::NewPosition, MotionOutput::NewQuaternion];
        if let Some([logit, lifetime]) = lifetime {
            let faded = lifetime::describe(&mut network, logit, lifetime, time);
            network.output(faded);
            outputs.push(MotionOutput::NewOpacityLogit);
        }
        let network = MotionNetwork { network, sources, outputs };
        MotionArrays { kind: self.kind().to_owned(), network: Some(network), tensors: Vec::new() }
    }

    /// The field that a file describes. What it was trained with is not in a file.
    ///
    /// # Errors
    /// Any other network than one that [`Self::describe`] makes.
    pub(super) fn of_description(arrays: &MotionArrays, device: &Device) -> Result<Self, ModelError> {
        let wrong = |what: String| ModelError::Motion(format!("the network is not that of control nodes: {what}"));
        let motion = arrays.network.as_ref().ok_or_else(|| wrong("there is none".to_owned()))?;
        let layers: Vec<&Layer> = motion.network.layers().collect();
        let [still, likes, lives] = [STILLNESS, AFFINITY, LIFETIME].map(|name| motion.sources.contains(&source(name)));
        let expected = 4 + usize::from(likes);
        let (&[anchors, translations, rotations, log_radii, ref others @ ..], true) =
            (layers.as_slice(), layers.len() == expected)
        else {
            return Err(wrong(format!("{} layers, expected {expected}", layers.len())));
        };
        let affinities = others.first().filter(|_| likes);
        let width = affinities.map_or(0, |layer| layer.inputs as usize);
        if affinities.is_some() && !(1..=MOST_AFFINITIES).contains(&width) {
            return Err(wrong(format!("{width} affinities, expected 1 to {MOST_AFFINITIES}")));
        }
        // A file may come from anybody: sizes first.
        let (nodes, knots) = (log_radii.outputs as usize, translations.inputs as usize);
        if !(1..=MOST_NODES).contains(&nodes) {
            return Err(wrong(format!("{nodes} nodes, expected 1 to {MOST_NODES}")));
        }
        if !(4..=MOST_KNOTS).contains(&knots) {
            return Err(wrong(format!("{knots} knots, expected 4 to {MOST_KNOTS}")));
        }
        for (name, layer, outputs, inputs) in [
            ("anchors", anchors, 3 * nodes, 1),
            ("translations", translations, 3 * nodes, knots),
            ("rotations", rotations, 4 * nodes, knots),
            ("logarithms of radii", log_radii, nodes, 1),
        ]
        .into_iter()
        .chain(affinities.map(|layer| ("affinities", *layer, nodes, width)))
        {
            let found = [layer.outputs as usize, layer.bias.len(), layer.weight.len()];
            let expected = [outputs, outputs, outputs * inputs];
            if found != expected {
                let what = format!("outputs, biases and weights of the {name} are {found:?}, expected {expected:?}");
                return Err(wrong(what));
            }
        }
        // What we do not keep must not do anything in the codec either.
        for (name, numbers) in [
            ("weights of the anchors", &anchors.weight),
            ("weights of the logarithms of radii", &log_radii.weight),
            ("biases of the translations", &translations.bias),
            ("biases of the rotations", &rotations.bias),
        ]
        .into_iter()
        .chain(affinities.map(|layer| ("biases of the affinities", &layer.bias)))
        {
            if let Some(number) = numbers.iter().find(|number| **number != 0.0) {
                return Err(wrong(format!("one of the {name} is {number}, expected 0")));
            }
        }
        let config = NodesFieldConfig {
            count: nodes,
            stillness: still,
            lifetime: lives,
            affinities: width,
            ..Default::default()
        };
        let mut field = Self::zeros(config, nodes, knots, device);
        field.anchors = Param::from_tensor(tensor(anchors.bias.clone(), [3, nodes], device).transpose());
        field.log_radii = Param::from_tensor(tensor(log_radii.bias.clone(), [nodes, 1], device));
        field.translations = Param::from_tensor(by_node(translations, nodes, device));
        field.rotations = Param::from_tensor(by_node(rotations, nodes, device));
        if let Some(layer) = affinities {
            field.affinities = Some(Param::from_tensor(tensor(layer.weight.clone(), [nodes, width], device)));
        }
        // Then everything but the numbers: the operations are those of such a field.
        let own = field.describe();
        let same = own.network.is_some_and(|own| {
            own.network.has_structure_of(&motion.network)
                && own.sources == motion.sources
                && own.outputs == motion.outputs
        });
        if same { Ok(field) } else { Err(wrong("operations, sources or outputs are others".to_owned())) }
    }
}

fn source(attribute: &str) -> MotionSource {
    MotionSource::Attribute(attribute.to_owned())
}

/// From knots `[K, C B]`, the C of a node behind each other, to a layer from the basis `[K]` to C blocks of B.
fn by_component(knots: Tensor<2>, nodes: usize) -> Layer {
    let [count, channels] = knots.dims();
    let components = channels / nodes;
    let columns = knots.reshape([count, nodes, components]).permute([2, 1, 0]);
    Layer::linear(numbers(columns), vec![0.0; channels])
}

/// The inverse of [`by_component`].
fn by_node(layer: &Layer, nodes: usize, device: &Device) -> Tensor<2> {
    let (channels, count) = (layer.outputs as usize, layer.inputs as usize);
    let columns = tensor(layer.weight.clone(), [channels, count], device);
    columns.reshape([channels / nodes, nodes, count]).permute([2, 1, 0]).reshape([count, channels])
}
