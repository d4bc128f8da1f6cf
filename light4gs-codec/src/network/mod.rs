//! Networks as data: a model describes them, a stream stores them, and the exact executor runs them.
//!
//! A [`Network`] is a bounded list of [`Node`]s, each of which reads only values before it. Values are maps `[channels,
//! height, width]`. Where a network is evaluated for single points, such as Gaussians, height and width are 1. The user
//! of a network gives its inputs and outputs their meaning: [`crate::Condition`], [`crate::ShPrior`],
//! [`crate::MotionArrays`]. So a new composition of layers needs no new line in this crate.
//!
//! ```
//! use light4gs_codec::network::{Layer, Network};
//!
//! let (mut network, [features]) = Network::new([2]);
//! let hidden = network.layer(features, Layer::linear(vec![1.0, 0.0, 0.0, 1.0], vec![0.0, 0.5]));
//! let rectified = network.relu(hidden);
//! let output = network.layer(rectified, Layer::linear(vec![1.0, 1.0], vec![0.0]));
//! network.output(output);
//! assert_eq!(network.evaluate(&[vec![3.0, -1.0]])?, [vec![3.0]]);
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! # Exactness
//!
//! If an encoder and a decoder differ in one bit of a parameter, the decoder reads wrong symbols. So nothing depends on
//! a library: every output of a layer is its bias, plus the products of weight and input in a fixed order, each product
//! and each sum rounded to float32. There are no fused multiply-adds (Rust does not contract). Of the platform's
//! functions only comparison, division and square root are used, which IEEE 754 defines to the bit; exponential and
//! logarithm are computed from these.
//!
//! | file | what |
//! |---|---|
//! | `check.rs` | requirements that a network must meet before it runs: channels, sizes, limits |
//! | `description.rs` | a network without its weights as bytes |
//! | `weights.rs`, `tensors.rs` | weights as bytes, quantized or float32 |
//! | `program/` | a network prepared for running, and what running it costs |
//! | `kernels/` | the operations |

mod check;
mod description;
pub(crate) mod kernels;
mod program;
pub(crate) mod tensors;
pub mod weights;

pub(crate) use program::{Dependence, Maps, Program, Workspace, blocks};

use crate::{CodecError, Limits};

/// A value of a network: the inputs come first, then one value for each node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Value(pub u32);

/// A network. See the [module](self).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Network {
    /// Channels of each input.
    pub inputs: Vec<u32>,
    /// The operations, in the order in which they are computed.
    pub nodes: Vec<Node>,
    /// The results.
    pub outputs: Vec<Value>,
}

/// One step of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// What it computes.
    pub operation: Operation,
    /// What it reads: values before it.
    pub inputs: Vec<Value>,
}

/// What a node computes from its inputs.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// A layer with weights, of one input.
    Layer(Layer),
    /// `x` where it is at least 0, else 0.
    Relu,
    /// `x` where it is at least 0, else the slope times `x`.
    LeakyRelu(f32),
    /// The input at the size of the network's target, bilinear with aligned corners.
    Resize,
    /// The mean over the rows: `[C, 1, W]`.
    MeanOverHeight,
    /// The mean over the columns: `[C, H, 1]`.
    MeanOverWidth,
    /// `[C, W, H]` of `[C, H, W]`.
    Transpose,
    /// The input, whose height or width may be 1, repeated to the size of the network's target.
    Spread,
    /// The channels of two or more inputs of the same size, one input after the other.
    Concatenate,
    /// The sum of two inputs, element by element. As in [`Operation::Subtract`], [`Operation::Multiply`] and
    /// [`Operation::Divide`], the second input may have fewer channels, a divisor of the first's; they are then
    /// repeated.
    Add,
    /// The first input minus the second one.
    Subtract,
    /// The product of two inputs.
    Multiply,
    /// The first input divided by the second one.
    Divide,
    /// `exp(x)`.
    Exponential,
    /// The natural logarithm.
    Logarithm,
    /// The square root.
    SquareRoot,
    /// `x · scale + offset`.
    Affine {
        /// Finite.
        scale: f32,
        /// Finite.
        offset: f32,
    },
    /// `x`, or the nearest end of the range where it is outside.
    Clamp {
        /// Finite.
        least: f32,
        /// Finite, not below the other end.
        most: f32,
    },
    /// The sum of each group of this many neighboring channels.
    GroupSum(u32),
    /// The largest of each group of this many neighboring channels.
    GroupMaximum(u32),
    /// The channels of these numbers, in this order.
    Select(Vec<u32>),
}

/// How a layer is applied to a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerKind {
    /// A convolution that keeps the size; zeros lie beyond the border.
    Convolution,
    /// The same at every second row and column.
    Halving,
    /// A transposed convolution with kernel 5, stride 2, padding 2, output padding 1 and one group, which doubles the size.
    Doubling,
    /// A convolution whose taps are 0 where their distance from the center (rows plus columns) is even. Its input must
    /// be the anchors of a checkerboard.
    Checkerboard,
}

/// A layer: `outputs` sums of a bias and weighted inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// How it is applied.
    pub kind: LayerKind,
    /// Channels of its input.
    pub inputs: u32,
    /// Channels of its output.
    pub outputs: u32,
    /// Side of the kernel: odd, at most 7.
    pub kernel: u32,
    /// Groups, a divisor of inputs and outputs, as in PyTorch.
    pub groups: u32,
    /// `[outputs, inputs / groups, kernel, kernel]` row-major; `[inputs, outputs, kernel, kernel]` for
    /// [`LayerKind::Doubling`].
    pub weight: Vec<f32>,
    /// `[outputs]`.
    pub bias: Vec<f32>,
}

impl Layer {
    /// `y = W x + b` at every place, from `weight [outputs, inputs]` and `bias [outputs]`.
    pub fn linear(weight: Vec<f32>, bias: Vec<f32>) -> Self {
        let outputs = bias.len() as u32;
        let inputs = (weight.len() / bias.len().max(1)) as u32;
        Self { kind: LayerKind::Convolution, inputs, outputs, kernel: 1, groups: 1, weight, bias }
    }

    /// The length that [`Layer::weight`] must have.
    pub fn weights(&self) -> u64 {
        let kernel = u64::from(self.kernel);
        u64::from(self.outputs) * u64::from(self.inputs / self.groups.max(1)) * kernel * kernel
    }

    /// The length of the weight without masked numbers, as a stream holds it.
    pub(crate) fn stored_weights(&self) -> u64 {
        let taps = u64::from(self.kernel) * u64::from(self.kernel);
        match self.kind {
            LayerKind::Checkerboard => self.weights() / taps.max(1) * kernels::masked_taps(self.kernel).count() as u64,
            _ => self.weights(),
        }
    }
}

impl Network {
    /// A network without nodes, and its inputs, with the given numbers of channels.
    pub fn new<const N: usize>(inputs: [u32; N]) -> (Self, [Value; N]) {
        let network = Self { inputs: inputs.to_vec(), ..Self::default() };
        (network, std::array::from_fn(|index| Value(index as u32)))
    }

    /// Appends a node.
    pub fn node(&mut self, operation: Operation, inputs: &[Value]) -> Value {
        self.nodes.push(Node { operation, inputs: inputs.to_vec() });
        Value((self.inputs.len() + self.nodes.len() - 1) as u32)
    }

    /// Appends a layer.
    pub fn layer(&mut self, input: Value, layer: Layer) -> Value {
        self.node(Operation::Layer(layer), &[input])
    }

    /// Appends a [`Operation::Relu`].
    pub fn relu(&mut self, input: Value) -> Value {
        self.node(Operation::Relu, &[input])
    }

    /// Appends a [`Operation::LeakyRelu`].
    pub fn leaky_relu(&mut self, input: Value, slope: f32) -> Value {
        self.node(Operation::LeakyRelu(slope), &[input])
    }

    /// Appends a value that is the same at all places: a layer that reads `any` value with weights of 0.
    pub fn constant(&mut self, any: Value, channels: u32, numbers: Vec<f32>) -> Value {
        self.layer(any, Layer::linear(vec![0.0; channels as usize * numbers.len()], numbers))
    }

    /// Declares an output.
    pub fn output(&mut self, value: Value) {
        self.outputs.push(value);
    }

    /// Its layers, in order.
    pub fn layers(&self) -> impl Iterator<Item = &Layer> {
        self.nodes.iter().filter_map(|node| match &node.operation {
            Operation::Layer(layer) => Some(layer),
            _ => None,
        })
    }

    /// Its layers, in order.
    pub fn layers_mut(&mut self) -> impl Iterator<Item = &mut Layer> {
        self.nodes.iter_mut().filter_map(|node| match &mut node.operation {
            Operation::Layer(layer) => Some(layer),
            _ => None,
        })
    }

    /// Whether another network has the same inputs, nodes and outputs, whatever their weights are.
    pub fn has_structure_of(&self, other: &Self) -> bool {
        self.clone().without_weights() == other.clone().without_weights()
    }

    /// The network as its description gives it: without weights and biases.
    pub(crate) fn without_weights(mut self) -> Self {
        self.layers_mut().for_each(|layer| (layer.weight, layer.bias) = (Vec::new(), Vec::new()));
        self
    }

    /// The outputs at one place from the inputs there, exactly as a decoder computes them.
    ///
    /// For tests, and for tools that need single values. It prepares the network anew each time.
    ///
    /// # Errors
    /// A network that is not legal, or that looks at more than one place; inputs of other lengths.
    pub fn evaluate(&self, inputs: &[Vec<f32>]) -> Result<Vec<Vec<f32>>, CodecError> {
        const SECTION: &str = "network";
        self.check(SECTION, "the network", &Limits::large())?;
        self.check_pointwise(SECTION, "the network")?;
        let found: Vec<_> = inputs.iter().map(Vec::len).collect();
        if !found.iter().copied().eq(self.inputs.iter().map(|&channels| channels as usize)) {
            let expected = format!("{:?}", self.inputs);
            return Err(CodecError::invalid(SECTION, "lengths of the inputs", format!("{found:?}"), expected));
        }
        let program = Program::pointwise(self, &vec![true; inputs.len()]);
        let mut workspace = program.workspace();
        for (index, values) in inputs.iter().enumerate() {
            let lanes = program.input_lanes(&mut workspace, index);
            lanes.iter_mut().zip(values).for_each(|(lanes, &value)| lanes[0] = kernels::kept(value));
        }
        program.run(&mut workspace);
        let outputs = (0..self.outputs.len()).map(|index| program.output_lanes(&workspace, index));
        Ok(outputs.map(|lanes| lanes.iter().map(|lanes| lanes[0]).collect()).collect())
    }
}
