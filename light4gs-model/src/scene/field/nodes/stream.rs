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
    /// Of the network's inputs.
    sources: Vec<MotionSource>,
    nodes: usize,
}

impl Description {
    /// An attribute of the Gaussians as a further input, behind those that are there.
    fn input(&mut self, attribute: &str, width: u32) -> Value {
        self.network.inputs.push(width);
        self.sources.push(source(attribute));
        Value(self.network.inputs.len() as u32 - 1)
    }

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

    /// `count` channels with the numbers `first`, `first + 1` and so on. Each node of the network doubles the channels, since
    /// a network may have few nodes.
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

    /// The weights of the knots: from `|t - knot|` in knots, the difference of two truncated cubes.
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

    /// The logits plus the inner products of a Gaussian's affinities and those of the nodes, `[B, H]` row by row.
    fn liked(&mut self, logits: Value, affinity: Value, of_nodes: Vec<f32>) -> Value {
        let layer = Layer::linear(of_nodes, vec![0.0; self.nodes]);
        let liking = self.network.layer(affinity, layer);
        self.node(Operation::Add, &[logits, liking])
    }

    /// Position and quaternion of a Gaussian that follows a blended pose.
    fn moved(&mut self, blended: Value, means: Value, quats: Value) -> [Value; 2] {
        let matrix = self.channels(blended, 0..9);
        let moved = self.node(Operation::Multiply, &[matrix, means]);
        let moved = self.node(Operation::GroupSum(3), &[moved]);
        let offset = self.channels(blended, 9..12);
        let position = self.node(Operation::Add, &[moved, offset]);
        let turn = self.channels(blended, 12..16);
        let negative = self.node(affine(-1.0, 0.0), &[turn]);
        let both = self.node(Operation::Concatenate, &[turn, negative]);
        let product = self.channels(both, PRODUCT);
        let turned = self.node(Operation::Multiply, &[product, quats]);
        let quaternion = self.node(Operation::GroupSum(4), &[turned]);
        [position, quaternion]
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

/// A layer of a description: the numbers of the field that it holds.
struct Part {
    name: &'static str,
    outputs: usize,
    inputs: usize,
    /// Whether the numbers are its weights; otherwise they are its biases. The others are 0.
    in_weights: bool,
}

impl Part {
    /// Why a layer cannot be this part.
    fn problem(&self, layer: &Layer) -> Option<String> {
        let Self { name, outputs, inputs, in_weights } = *self;
        let found = [layer.outputs as usize, layer.bias.len(), layer.weight.len()];
        let expected = [outputs, outputs, outputs * inputs];
        if found != expected {
            return Some(format!("outputs, biases and weights of the {name} are {found:?}, expected {expected:?}"));
        }
        // The field does not keep these numbers, so they must be without effect in the codec too.
        let (unused, numbers) = if in_weights { ("biases", &layer.bias) } else { ("weights", &layer.weight) };
        let number = numbers.iter().find(|number| **number != 0.0)?;
        Some(format!("one of the {unused} of the {name} is {number}, expected 0"))
    }
}

/// The numbers of nodes, of knots and of affinities that a description has.
struct Sizes {
    nodes: usize,
    knots: usize,
    affinities: usize,
}

impl Sizes {
    /// From the layers of a description, in their order.
    ///
    /// # Errors
    /// As text: another number of layers, sizes that no field has.
    fn of(layers: &[&Layer], has_affinities: bool) -> Result<Self, String> {
        let expected = 4 + usize::from(has_affinities);
        let (&[_, translations, _, log_radii, ref others @ ..], true) = (layers, layers.len() == expected) else {
            return Err(format!("{} layers, expected {expected}", layers.len()));
        };
        let [nodes, knots] = [log_radii.outputs, translations.inputs].map(|size| size as usize);
        let affinities = others.first().map_or(0, |layer| layer.inputs as usize);
        if has_affinities && !(1..=MOST_AFFINITIES).contains(&affinities) {
            return Err(format!("{affinities} affinities, expected 1 to {MOST_AFFINITIES}"));
        }
        if !(1..=MOST_NODES).contains(&nodes) {
            return Err(format!("{nodes} nodes, expected 1 to {MOST_NODES}"));
        }
        if !(4..=MOST_KNOTS).contains(&knots) {
            return Err(format!("{knots} knots, expected 4 to {MOST_KNOTS}"));
        }
        Ok(Self { nodes, knots, affinities })
    }

    /// The layers of a description of these sizes, in their order.
    fn parts(&self) -> Vec<Part> {
        let Self { nodes, knots, affinities } = *self;
        let part = |name, outputs, inputs, in_weights| Part { name, outputs, inputs, in_weights };
        let mut parts = vec![
            part("anchors", 3 * nodes, 1, false),
            part("translations", 3 * nodes, knots, true),
            part("rotations", 4 * nodes, knots, true),
            part("logarithms of radii", nodes, 1, false),
        ];
        parts.extend((affinities > 0).then(|| part("affinities", nodes, affinities, true)));
        parts
    }
}

impl NodesField {
    /// The field as operations of the codec. Its layers are those of [`Sizes::parts`].
    pub(super) fn describe(&self) -> MotionArrays {
        let (network, [time, means, quats]) = Network::new([1, 3, 4]);
        let sources = vec![MotionSource::Time, source("means"), source("quats")];
        let mut description = Description { network, sources, nodes: self.nodes() };
        let stillness = self.config.stillness.then(|| description.input(STILLNESS, 1));
        let width = |affinities: &Param<Tensor<2>>| affinities.dims()[1] as u32;
        let affinity = self.affinities.as_ref().map(|all| (all, description.input(AFFINITY, width(all))));
        let lifetime =
            self.config.lifetime.then(|| [description.input("opacity_logits", 1), description.input(LIFETIME, 2)]);

        let (anchors, mut poses) = self.describe_poses(&mut description, time);
        let log_radii = self.log_radii.val() + self.unit.val().log().unsqueeze();
        let log_radii = description.network.constant(time, 1, numbers(log_radii));
        let mut logits = description.logits(means, anchors, log_radii);
        if let Some((of_nodes, affinity)) = affinity {
            logits = description.liked(logits, affinity, numbers(of_nodes.val()));
        }
        let mut count = self.nodes();
        if let Some(stillness) = stillness {
            poses = description.with_identity(poses);
            logits = description.node(Operation::Concatenate, &[logits, stillness]);
            count += 1;
        }
        let blended = description.blended(poses, logits, count);
        let moved = description.moved(blended, means, quats);

        let Description { mut network, sources, .. } = description;
        moved.into_iter().for_each(|value| network.output(value));
        let mut outputs = vec![MotionOutput::NewPosition, MotionOutput::NewQuaternion];
        if let Some([logit, lifetime]) = lifetime {
            let faded = lifetime::describe(&mut network, logit, lifetime, time);
            network.output(faded);
            outputs.push(MotionOutput::NewOpacityLogit);
        }
        let network = MotionNetwork { network, sources, outputs };
        MotionArrays { kind: self.kind().to_owned(), network: Some(network), tensors: Vec::new() }
    }

    /// The nodes' anchors, and their poses at a time, world units.
    fn describe_poses(&self, description: &mut Description, time: Value) -> (Value, Value) {
        let nodes = self.nodes();
        let anchors = numbers(self.world_anchors().transpose());
        let anchors = description.network.constant(time, 1, anchors);
        let basis = description.basis(time, self.knots());
        let unit = self.unit.val().unsqueeze();
        let translations = by_component(self.translations.val() * unit, nodes);
        let rotations = by_component(self.rotations.val(), nodes);
        (anchors, description.poses(basis, anchors, translations, rotations))
    }

    /// The field that a file describes. The settings of its training are not in a file.
    ///
    /// # Errors
    /// Any other network than one that [`Self::describe`] makes.
    pub(super) fn of_description(arrays: &MotionArrays, device: &Device) -> Result<Self, ModelError> {
        let wrong = |what: String| ModelError::Motion(format!("the network is not that of control nodes: {what}"));
        let motion = arrays.network.as_ref().ok_or_else(|| wrong("there is none".to_owned()))?;
        let layers: Vec<&Layer> = motion.network.layers().collect();
        let [still, likes, lives] = [STILLNESS, AFFINITY, LIFETIME].map(|name| motion.sources.contains(&source(name)));
        // A file may come from anybody: sizes first.
        let sizes = Sizes::of(&layers, likes).map_err(wrong)?;
        if let Some(problem) = sizes.parts().iter().zip(&layers).find_map(|(part, layer)| part.problem(layer)) {
            return Err(wrong(problem));
        }
        let config = NodesFieldConfig {
            count: sizes.nodes,
            stillness: still,
            lifetime: lives,
            affinities: sizes.affinities,
            ..Default::default()
        };
        let field = Self::of_layers(config, &sizes, &layers, device);
        // Then everything but the numbers: the operations are those of such a field.
        let own = field.describe();
        let same = own.network.is_some_and(|own| {
            own.network.has_structure_of(&motion.network)
                && own.sources == motion.sources
                && own.outputs == motion.outputs
        });
        if same { Ok(field) } else { Err(wrong("operations, sources or outputs are others".to_owned())) }
    }

    /// The field whose numbers are in the layers of [`Sizes::parts`].
    fn of_layers(config: NodesFieldConfig, sizes: &Sizes, layers: &[&Layer], device: &Device) -> Self {
        let Sizes { nodes, knots, affinities } = *sizes;
        let mut field = Self::zeros(config, nodes, knots, device);
        field.anchors = Param::from_tensor(tensor(layers[0].bias.clone(), [3, nodes], device).transpose());
        field.translations = Param::from_tensor(by_node(layers[1], nodes, device));
        field.rotations = Param::from_tensor(by_node(layers[2], nodes, device));
        field.log_radii = Param::from_tensor(tensor(layers[3].bias.clone(), [nodes, 1], device));
        field.affinities =
            layers.get(4).map(|layer| Param::from_tensor(tensor(layer.weight.clone(), [nodes, affinities], device)));
        field
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
