//! Bits of values under mixtures of logistics, as a Burn operation: one pass over the values in place of some forty, each of which
//! reads and writes `[C, K, N]` numbers.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, backend_extension};
use burn::tensor::Tensor;

use super::{for_all_back_ends, recorded};

/// Most logistics of a mixture.
pub const MOST_COMPONENTS: usize = 4;

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
#[derive(Clone, Debug, ExtensionType)]
pub struct MixtureTensors<B: Backend> {
    /// `[C, N]`.
    pub values: FloatTensor<B>,
    /// `[C, 1]`: widths of the intervals around the values of a channel.
    pub widths: FloatTensor<B>,
    /// `[C, K]`, through softmax.
    pub weight_logits: FloatTensor<B>,
    /// `[C, K]`, in the units of the values.
    pub means: FloatTensor<B>,
    /// `[C, K]`, natural logarithms.
    pub log_scales: FloatTensor<B>,
}

/// Tensors of [`MixtureTensors`].
const INPUTS: usize = 5;

impl<B: Backend> MixtureTensors<B> {
    fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.values, self.widths, self.weight_logits, self.means, self.log_scales]
    }

    fn from_array([values, widths, weight_logits, means, log_scales]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { values, widths, weight_logits, means, log_scales }
    }
}

/// A back end's kernels. [`MixtureBitsOps`] adds the dispatch and the tape.
pub trait MixtureBitsKernels: Backend {
    /// What the backward pass needs from the forward pass.
    type Inputs: Clone + Debug + Send + 'static;

    /// Bits of each channel `[C]`. Likelihoods below `bound` are raised to it.
    fn mixture_bits_forward(tensors: MixtureTensors<Self>, bound: f32) -> (FloatTensor<Self>, Self::Inputs);

    /// Gradients of all inputs from that of the bits `[C]`; below the bound, that of
    /// [`lower_bound`](crate::ops::lower_bound::lower_bound).
    fn mixture_bits_backward(inputs: Self::Inputs, gradient: FloatTensor<Self>) -> MixtureTensors<Self>;
}

/// The bits on every back end that has [`MixtureBitsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait MixtureBitsOps: Backend {
    /// Bits of each channel `[C]`; see [`mixture_bits`].
    fn mixture_bits(#[extension_type] tensors: MixtureTensors<Self>, bound: f32) -> FloatTensor<Self>;
}

for_all_back_ends! {
    MixtureBitsOps with MixtureBitsKernels {
        fn mixture_bits(tensors: MixtureTensors<Self>, bound: f32) -> FloatTensor<Self> {
            Self::mixture_bits_forward(tensors, bound).0
        }
    }
}

impl<B: MixtureBitsOps + MixtureBitsKernels, C: CheckpointStrategy> MixtureBitsOps for Autodiff<B, C> {
    fn mixture_bits(tensors: MixtureTensors<Self>, bound: f32) -> FloatTensor<Self> {
        let tensors = tensors.into_array();
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let inner = MixtureTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        recorded::<B, C, _, _>(nodes, B::mixture_bits_forward(inner, bound), |inputs, gradient| {
            B::mixture_bits_backward(inputs, gradient).into_array()
        })
    }
}

/// Values, and for each channel of them a mixture of logistics.
#[derive(Clone, Debug)]
pub struct MixtureInputs {
    /// `[C, N]`.
    pub values: Tensor<2>,
    /// `[C, 1]`: widths of the intervals around the values of a channel.
    pub widths: Tensor<2>,
    /// `[C, K]`, through softmax; K is at most [`MOST_COMPONENTS`].
    pub weight_logits: Tensor<2>,
    /// `[C, K]`, in the units of the values.
    pub means: Tensor<2>,
    /// `[C, K]`, natural logarithms.
    pub log_scales: Tensor<2>,
}

/// The bits of each channel `[C]`: the sum of `-log2` of the probabilities of the intervals around its values, each of which is
/// raised to `bound` with the gradient of [`lower_bound`](crate::ops::lower_bound::lower_bound).
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::mixture_bits::{MixtureInputs, mixture_bits};
///
/// let device = Device::flex();
/// let zeros = Tensor::<2>::zeros([1, 1], &device);
/// // Between -ln 3 and ln 3 is half of a logistic's mass.
/// let bits = mixture_bits(
///     MixtureInputs {
///         values: Tensor::zeros([1, 3], &device),
///         widths: Tensor::full([1, 1], 2.0 * 3.0f32.ln(), &device),
///         weight_logits: zeros.clone(),
///         means: zeros.clone(),
///         log_scales: zeros,
///     },
///     1e-9,
/// );
/// assert!((bits.into_scalar::<f32>() - 3.0).abs() < 1e-5);
/// ```
///
/// # Panics
/// If the shapes do not belong together; the message names the tensor.
pub fn mixture_bits(inputs: MixtureInputs, bound: f32) -> Tensor<1> {
    let MixtureInputs { values, widths, weight_logits, means, log_scales } = inputs;
    let [channels, components] = means.dims();
    assert!((1..=MOST_COMPONENTS).contains(&components), "means must have 1 to {MOST_COMPONENTS} columns");
    assert_eq!(values.dims()[0], channels, "values must be [C, N]");
    assert_eq!(widths.dims(), [channels, 1], "widths must be [C, 1]");
    assert_eq!(weight_logits.dims(), [channels, components], "weight_logits must be [C, K]");
    assert_eq!(log_scales.dims(), [channels, components], "log_scales must be [C, K]");
    Tensor::from_dispatch(Dispatch::mixture_bits(
        MixtureTensors {
            values: values.into_dispatch(),
            widths: widths.into_dispatch(),
            weight_logits: weight_logits.into_dispatch(),
            means: means.into_dispatch(),
            log_scales: log_scales.into_dispatch(),
        },
        bound,
    ))
}
