//! Probabilities of intervals under learned densities, as a Burn operation: one pass over the values in place of some hundred, each
//! of which reads and writes three numbers for each edge of an interval.
//!
//! A channel's density is a small network whose output, the logit of the distribution function, increases with its input: layer `i`
//! is `l <- softplus(M_i) l + b_i`, then `l <- l + tanh(f_i) tanh(l)` if it bends (Ballé et al. 2018, appendix 6.1). Both edges of an
//! interval go through it; the probability is the difference of their logistic functions, on the side of zero where these are small
//! and so have full precision.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;
use std::ops::Range;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// Most layers of a density's network, with the last.
pub const MOST_LAYERS: usize = 5;
/// Most numbers that one of its layers takes or gives.
pub const MOST_WIDTH: usize = 3;

/// A layer of a density's network, and the places of its parameters in a channel's row of them: its matrix, output by output, then
/// its bias, then the factor of its nonlinearity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DensityLayer {
    /// Where its parameters begin.
    start: usize,
    /// Numbers in.
    pub inputs: usize,
    /// Numbers out.
    pub outputs: usize,
    /// Whether it has a nonlinearity.
    pub bends: bool,
}

impl DensityLayer {
    /// Places of the matrix `[outputs, inputs]`, which goes through softplus.
    pub fn matrix(&self) -> Range<usize> {
        self.start..self.start + self.outputs * self.inputs
    }

    /// Places of the bias `[outputs]`.
    pub fn bias(&self) -> Range<usize> {
        let start = self.matrix().end;
        start..start + self.outputs
    }

    /// Places of the factor `[outputs]`, which goes through tanh, if the layer bends.
    pub fn factor(&self) -> Option<Range<usize>> {
        let start = self.bias().end;
        self.bends.then_some(start..start + self.outputs)
    }

    fn end(&self) -> usize {
        self.factor().unwrap_or(self.bias()).end
    }
}

/// The layers of a density's network, from one number to one number.
///
/// ```
/// use light4gs_model::ops::density_likelihood::DensityShape;
///
/// let shape = DensityShape::new(&[3, 2], false);
/// let layers: Vec<[usize; 2]> = shape.layers().iter().map(|layer| [layer.outputs, layer.inputs]).collect();
/// assert_eq!(layers, [[3, 1], [2, 3], [1, 2]]);
/// // Three matrices, three biases, and factors for all layers but the last.
/// assert_eq!(shape.parameters(), (3 + 6 + 2) + (3 + 2 + 1) + (3 + 2));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct DensityShape(Vec<DensityLayer>);

impl DensityShape {
    /// A network with hidden layers of these widths. All layers bend, the last one only if `bend_last_layer`.
    ///
    /// # Panics
    /// If it has more than [`MOST_LAYERS`] layers, or a hidden layer's width is not 1 to [`MOST_WIDTH`].
    pub fn new(filters: &[usize], bend_last_layer: bool) -> Self {
        let count = filters.len() + 1;
        assert!(
            count <= MOST_LAYERS && filters.iter().all(|width| (1..=MOST_WIDTH).contains(width)),
            "filters are {filters:?}: a density has at most {} hidden layers, of width 1 to {MOST_WIDTH}",
            MOST_LAYERS - 1
        );
        let mut layers: Vec<DensityLayer> = Vec::with_capacity(count);
        for (number, outputs) in filters.iter().copied().chain([1]).enumerate() {
            let (start, inputs) = layers.last().map_or((0, 1), |layer| (layer.end(), layer.outputs));
            layers.push(DensityLayer { start, inputs, outputs, bends: bend_last_layer || number + 1 < count });
        }
        Self(layers)
    }

    /// The layers.
    pub fn layers(&self) -> &[DensityLayer] {
        &self.0
    }

    /// Parameters of a channel.
    pub fn parameters(&self) -> usize {
        self.0.last().map_or(0, DensityLayer::end)
    }
}

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
#[derive(Clone, Debug, ExtensionType)]
pub struct DensityTensors<B: Backend> {
    /// `[C, N]`: middles of the intervals.
    pub values: FloatTensor<B>,
    /// `[C, P]`: a row for each channel, layer by layer.
    pub parameters: FloatTensor<B>,
}

/// Tensors of [`DensityTensors`].
const INPUTS: usize = 2;

impl<B: Backend> DensityTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.values, self.parameters]
    }

    fn from_array([values, parameters]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { values, parameters }
    }
}

/// A back end's kernels. [`DensityLikelihoodOps`] adds the dispatch and the tape.
pub trait DensityLikelihoodKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Inputs: Clone + Debug + Send + 'static;

    /// Probabilities `[C, N]` of the intervals of this width around the values.
    fn density_likelihood_forward(
        tensors: DensityTensors<Self>,
        shape: DensityShape,
        width: f32,
    ) -> (FloatTensor<Self>, Self::Inputs);

    /// Gradients of all inputs from that of the probabilities `[C, N]`.
    fn density_likelihood_backward(inputs: Self::Inputs, gradient: FloatTensor<Self>) -> DensityTensors<Self>;
}

/// The probabilities on every back end that has [`DensityLikelihoodKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait DensityLikelihoodOps: Backend {
    /// Probabilities `[C, N]`; see [`density_likelihood`].
    fn density_likelihood(
        #[extension_type] tensors: DensityTensors<Self>,
        shape: DensityShape,
        width: f32,
    ) -> FloatTensor<Self>;
}

for_all_back_ends! {
    DensityLikelihoodOps with DensityLikelihoodKernels {
        fn density_likelihood(tensors: DensityTensors<Self>, shape: DensityShape, width: f32) -> FloatTensor<Self> {
            Self::density_likelihood_forward(tensors, shape, width).0
        }
    }
}

impl<B: DensityLikelihoodOps + DensityLikelihoodKernels, C: CheckpointStrategy> DensityLikelihoodOps
    for Autodiff<B, C>
{
    fn density_likelihood(tensors: DensityTensors<Self>, shape: DensityShape, width: f32) -> FloatTensor<Self> {
        let tensors = tensors.into_array();
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let inner = DensityTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        recorded::<B, C, _, _>(nodes, B::density_likelihood_forward(inner, shape, width), |inputs, gradient| {
            B::density_likelihood_backward(inputs, gradient).into_array()
        })
    }
}

/// Probabilities `[C, N]` of the intervals of this width around `values [C, N]`, without a lower bound. Row `c` of
/// `parameters [C, P]` is the density of channel `c`; [`DensityShape`] says where its numbers stand.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::density_likelihood::{DensityShape, density_likelihood};
///
/// let device = Device::flex();
/// // One layer: softplus(ln(e - 1)) is 1, so the density is that of a logistic.
/// let parameters = Tensor::<2>::from_floats([[(std::f32::consts::E - 1.0).ln(), 0.0]], &device);
/// let values = Tensor::<2>::zeros([1, 1], &device);
/// // Between -ln 3 and ln 3 is half of its mass.
/// let half = density_likelihood(values, parameters, &DensityShape::new(&[], false), 2.0 * 3.0f32.ln());
/// assert!((half.into_scalar::<f32>() - 0.5).abs() < 1e-6);
/// ```
///
/// # Panics
/// If the shapes do not belong together; the message names the tensor.
pub fn density_likelihood(values: Tensor<2>, parameters: Tensor<2>, shape: &DensityShape, width: f32) -> Tensor<2> {
    let channels = values.dims()[0];
    assert_eq!(parameters.dims(), [channels, shape.parameters()], "parameters must be [C, P]");
    Tensor::from_dispatch(Dispatch::density_likelihood(
        DensityTensors { values: values.into_dispatch(), parameters: parameters.into_dispatch() },
        shape.clone(),
        width,
    ))
}
