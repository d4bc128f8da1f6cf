//! Bits under mixtures of logistics: values, densities, gradients.

use std::fmt::Debug;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, ExtensionType};

/// Most logistics of a mixture.
pub const MOST_COMPONENTS: usize = 4;

/// The differentiable inputs, or their gradients, in the order that gradients are registered in.
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
pub(crate) const INPUTS: usize = 5;

impl<B: Backend> MixtureTensors<B> {
    pub(crate) fn into_array(self) -> [FloatTensor<B>; INPUTS] {
        [self.values, self.widths, self.weight_logits, self.means, self.log_scales]
    }

    pub(crate) fn from_array([values, widths, weight_logits, means, log_scales]: [FloatTensor<B>; INPUTS]) -> Self {
        Self { values, widths, weight_logits, means, log_scales }
    }
}

/// A back end's kernels. [`MixtureBitsOps`](crate::ops::rate::mixture_bits::MixtureBitsOps) adds the dispatch and the tape.
pub trait MixtureBitsKernels: Backend {
    /// What the backward pass wants to see again.
    type Inputs: Clone + Debug + Send + 'static;

    /// Bits of each channel `[C]`. Likelihoods below `bound` are raised to it.
    fn mixture_bits_forward(tensors: MixtureTensors<Self>, bound: f32) -> (FloatTensor<Self>, Self::Inputs);

    /// Gradients of all inputs from that of the bits `[C]`; below the bound, that of
    /// [`lower_bound`](crate::ops::lower_bound::lower_bound).
    fn mixture_bits_backward(inputs: Self::Inputs, gradient: FloatTensor<Self>) -> MixtureTensors<Self>;
}
