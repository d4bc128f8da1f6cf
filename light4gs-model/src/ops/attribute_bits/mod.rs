//! Bits of the attributes of Gaussians, as a Burn operation: a linear prediction of each number, a mixture of logistics for its
//! residual, and a count of the cells of the positions. Burn's own operations for it are some hundred, of which those of the
//! densities read and write `[C, K, M]` numbers each.

mod cpu;
mod cpu_mixture;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;
use std::ops::Range;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// Most logistics of a mixture.
pub const MOST_COMPONENTS: usize = 4;
/// Most attributes that have densities.
pub const MOST_ATTRIBUTES: usize = 16;

/// An attribute whose numbers have densities.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttributeChannels {
    /// Its channels, which follow those of the attribute before.
    pub channels: Range<usize>,
    /// The place of its step, and of its factor.
    pub place: usize,
}

/// The rows of the numbers `[3 C, M]` from which a channel is predicted, of `count` channels together, where `first` is the first
/// channel of its attribute: the channels of its attribute before it, the means of the neighbors' channels up to it, and itself in the
/// nearest neighbor. The codec predicts from the same numbers (`light4gs_codec::attributes`).
pub fn prediction_inputs(first: usize, channel: usize, count: usize) -> impl Iterator<Item = usize> {
    let (own, around) = (first..channel, count + first..=count + channel);
    own.chain(around).chain([2 * count + channel])
}

/// Positions as a set of points in a box.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionSet {
    /// The place of their step, which is in units of the Gaussians' size.
    pub place: usize,
    /// Of the box, in units of the Gaussians' size.
    pub extent: [f32; 3],
    /// Number of points.
    pub count: usize,
    /// Their bits in a file, if they are known. Otherwise they count as uniform in their box: the cell of each point, less the
    /// order of the points. The derivative is always that of such a set: half the step takes one bit more for each axis.
    pub coded: Option<u64>,
}

impl PositionSet {
    /// Bits for each natural logarithm of the number of an axis' cells.
    fn scale(&self) -> f32 {
        (self.count.max(1) as f64 * std::f64::consts::LOG2_E) as f32
    }

    /// Bits besides those of the cells, and whether those of the cells count.
    fn further_bits(&self) -> (f32, bool) {
        let count = self.count.max(1) as f64;
        match self.coded {
            Some(bits) => (bits as f32, false),
            // Stirling's formula for the orders that are not told apart.
            None => ((-count * (count.log2() - std::f64::consts::LOG2_E)) as f32, true),
        }
    }
}

/// What is counted, and how much it counts.
#[derive(Clone, Debug, PartialEq)]
pub struct CountedBits {
    /// The attributes that have densities; together they have all C channels, in order.
    pub attributes: Vec<AttributeChannels>,
    /// The positions, if they are counted.
    pub positions: Option<PositionSet>,
    /// Likelihoods below this are raised to it.
    pub bound: f32,
    /// All Gaussians, divided by those whose numbers are given.
    pub share: f32,
    /// What a bit counts.
    pub weight: f32,
}

impl CountedBits {
    /// For each channel, its attribute.
    fn by_channel(&self) -> impl Iterator<Item = (usize, &AttributeChannels)> {
        self.attributes.iter().flat_map(|attribute| attribute.channels.clone().map(move |channel| (channel, attribute)))
    }
}

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
#[derive(Clone, Debug, ExtensionType)]
pub struct AttributeBitsTensors<B: Backend> {
    /// `[3 C, M]`: a column for each Gaussian with its numbers, the means over its neighbors, those of the nearest one.
    pub numbers: FloatTensor<B>,
    /// `[C, 3 C]`: weights of the prediction.
    pub prediction: FloatTensor<B>,
    /// `[A]`: natural logarithms of the steps.
    pub log_steps: FloatTensor<B>,
    /// `[C, K]`, through softmax.
    pub weight_logits: FloatTensor<B>,
    /// `[C, K]`, in the units of the numbers.
    pub means: FloatTensor<B>,
    /// `[C, K]`, natural logarithms.
    pub log_scales: FloatTensor<B>,
    /// `[A]`: what the bits of an attribute with densities are multiplied by. It has no gradient.
    pub factors: FloatTensor<B>,
}

/// Differentiable tensors of [`AttributeBitsTensors`].
const INPUTS: usize = 6;

impl<B: Backend> AttributeBitsTensors<B> {
    fn into_parts(self) -> ([FloatTensor<B>; INPUTS], FloatTensor<B>) {
        let Self { numbers, prediction, log_steps, weight_logits, means, log_scales, factors } = self;
        ([numbers, prediction, log_steps, weight_logits, means, log_scales], factors)
    }

    fn from_parts(differentiable: [FloatTensor<B>; INPUTS], factors: FloatTensor<B>) -> Self {
        let [numbers, prediction, log_steps, weight_logits, means, log_scales] = differentiable;
        Self { numbers, prediction, log_steps, weight_logits, means, log_scales, factors }
    }
}

/// A back end's kernels. [`AttributeBitsOps`] adds the dispatch and the tape.
pub trait AttributeBitsKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Saved: Clone + Debug + Send + 'static;

    /// Bits of the positions and of each channel, `[1 + C]`.
    fn attribute_bits_forward(
        tensors: AttributeBitsTensors<Self>,
        counted: CountedBits,
    ) -> (FloatTensor<Self>, Self::Saved);

    /// Gradients of all differentiable inputs from that of the bits `[1 + C]`; of likelihoods below the bound, that of
    /// [`lower_bound`](crate::ops::lower_bound::lower_bound).
    fn attribute_bits_backward(saved: Self::Saved, gradient: FloatTensor<Self>) -> [FloatTensor<Self>; INPUTS];
}

/// The bits on every back end that has [`AttributeBitsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait AttributeBitsOps: Backend {
    /// Bits of the positions and of each channel, `[1 + C]`; see [`attribute_bits`].
    fn attribute_bits(#[extension_type] tensors: AttributeBitsTensors<Self>, counted: CountedBits)
    -> FloatTensor<Self>;
}

for_all_back_ends! {
    AttributeBitsOps with AttributeBitsKernels {
        fn attribute_bits(tensors: AttributeBitsTensors<Self>, counted: CountedBits) -> FloatTensor<Self> {
            Self::attribute_bits_forward(tensors, counted).0
        }
    }
}

impl<B: AttributeBitsOps + AttributeBitsKernels, C: CheckpointStrategy> AttributeBitsOps for Autodiff<B, C> {
    fn attribute_bits(tensors: AttributeBitsTensors<Self>, counted: CountedBits) -> FloatTensor<Self> {
        let (differentiable, factors) = tensors.into_parts();
        let nodes = differentiable.each_ref().map(|tensor| tensor.node());
        let inner = differentiable.map(|tensor| tensor.into_primitive());
        let inner = AttributeBitsTensors::from_parts(inner, factors.into_primitive());
        recorded::<B, C, _, _>(nodes, B::attribute_bits_forward(inner, counted), |saved, gradient| {
            B::attribute_bits_backward(saved, gradient)
        })
    }
}

/// Numbers of Gaussians, and what they are coded with. `C` channels belong to attributes, of which there are `A`.
#[derive(Clone, Debug)]
pub struct AttributeBitsInputs {
    /// `[3 C, M]`: a column for each Gaussian with its numbers, the means over its neighbors, those of the nearest one, as
    /// [`neighborhoods`](crate::ops::neighborhoods::neighborhoods) finds them.
    pub numbers: Tensor<2>,
    /// `[C, 3 C]`: weights of the prediction. Those that [`prediction_inputs`] does not name are not used.
    pub prediction: Tensor<2>,
    /// `[A]`: natural logarithms of the steps.
    pub log_steps: Tensor<1>,
    /// `[C, K]`, through softmax; K is at most [`MOST_COMPONENTS`].
    pub weight_logits: Tensor<2>,
    /// `[C, K]`, in the units of the numbers.
    pub means: Tensor<2>,
    /// `[C, K]`, natural logarithms.
    pub log_scales: Tensor<2>,
    /// `[A]`: what the bits of an attribute with densities are multiplied by. It gets no gradient.
    pub factors: Tensor<1>,
}

/// The bits of the positions, then of each channel, `[1 + C]`, all times the weight. A channel has the sum of `-log2` of the
/// probabilities of the intervals around its residuals, as wide as its step, each raised to the bound with the gradient of
/// [`lower_bound`](crate::ops::lower_bound::lower_bound).
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::attribute_bits::{AttributeBitsInputs, AttributeChannels, CountedBits, attribute_bits};
///
/// let device = Device::flex();
/// let zeros = Tensor::<2>::zeros([1, 1], &device);
/// // Between -ln 3 and ln 3 is half of a logistic's mass.
/// let step = 2.0 * 3.0f32.ln();
/// let inputs = AttributeBitsInputs {
///     numbers: Tensor::zeros([3, 5], &device),
///     prediction: Tensor::zeros([1, 3], &device),
///     log_steps: Tensor::from_floats([step.ln()], &device),
///     weight_logits: zeros.clone(),
///     means: zeros.clone(),
///     log_scales: zeros,
///     factors: Tensor::ones([1], &device),
/// };
/// let attributes = vec![AttributeChannels { channels: 0..1, place: 0 }];
/// let counted = CountedBits { attributes, positions: None, bound: 1e-9, share: 2.0, weight: 1.0 };
/// let bits = attribute_bits(inputs, counted).into_data().to_vec::<f32>().unwrap();
/// assert!(bits[0] == 0.0 && (bits[1] - 10.0).abs() < 1e-5);
/// ```
///
/// # Panics
/// If the shapes do not belong together (the message names the tensor), or there are more than [`MOST_ATTRIBUTES`].
pub fn attribute_bits(inputs: AttributeBitsInputs, counted: CountedBits) -> Tensor<1> {
    let AttributeBitsInputs { numbers, prediction, log_steps, weight_logits, means, log_scales, factors } = inputs;
    let [channels, components] = means.dims();
    assert!((1..=MOST_COMPONENTS).contains(&components), "means must have 1 to {MOST_COMPONENTS} columns");
    assert_eq!(weight_logits.dims(), [channels, components], "weight_logits must be [C, K]");
    assert_eq!(log_scales.dims(), [channels, components], "log_scales must be [C, K]");
    assert_eq!(numbers.dims()[0], 3 * channels, "numbers must be [3 C, M]");
    assert_eq!(prediction.dims(), [channels, 3 * channels], "prediction must be [C, 3 C]");
    assert_eq!(factors.dims(), log_steps.dims(), "factors and log_steps must be [A]");
    assert!(counted.attributes.len() <= MOST_ATTRIBUTES, "there are at most {MOST_ATTRIBUTES} attributes");
    assert!(counted.by_channel().map(|(channel, _)| channel).eq(0..channels), "the attributes must have all channels");
    let places = counted.attributes.iter().map(|attribute| attribute.place);
    let places = places.chain(counted.positions.iter().map(|positions| positions.place));
    assert!(places.max() < Some(log_steps.dims()[0]), "log_steps must have the steps of all attributes");
    Tensor::from_dispatch(Dispatch::attribute_bits(
        AttributeBitsTensors {
            numbers: numbers.into_dispatch(),
            prediction: prediction.into_dispatch(),
            log_steps: log_steps.into_dispatch(),
            weight_logits: weight_logits.into_dispatch(),
            means: means.into_dispatch(),
            log_scales: log_scales.into_dispatch(),
            factors: factors.into_dispatch(),
        },
        counted,
    ))
}
