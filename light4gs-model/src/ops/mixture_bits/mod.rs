//! Bits of values under mixtures of logistics, as a Burn operation: one pass over the values in place of some forty, each of which
//! reads and writes `[C, K, N]` numbers.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, backend_extension};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};

#[cfg(feature = "wgpu")]
use super::super::fusion::{leaf, resolve};
use super::super::host::{HostBackend, HostTensor};
use super::super::{differentiate, for_all_back_ends, for_cpu_back_ends};
use crate::cpu::mixture_bits::{MixtureSlices, mixture_bits as bits_of_slices, mixture_bits_backward};
use crate::kernels::mixture_bits::INPUTS;
pub use crate::kernels::mixture_bits::{MOST_COMPONENTS, MixtureBitsKernels, MixtureTensors};

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
        #[derive(Debug)]
        struct MixtureBits;

        impl<B: MixtureBitsKernels> Backward<B, INPUTS> for MixtureBits {
            type State = B::Inputs;

            fn backward(self, ops: Ops<Self::State, INPUTS>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |inputs, gradient| {
                    B::mixture_bits_backward(inputs, gradient).into_array()
                });
            }
        }

        let tensors = tensors.into_array();
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let inner = MixtureTensors::from_array(tensors.map(|tensor| tensor.into_primitive()));
        let (bits, inputs) = B::mixture_bits_forward(inner, bound);
        match MixtureBits.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(inputs, bits),
            OpsKind::UnTracked(prep) => prep.finish(bits),
        }
    }
}

/// Inputs of the CPU back ends.
#[derive(Clone, Debug)]
pub struct CpuInputs {
    inputs: [HostTensor; INPUTS],
    bound: f32,
}

impl CpuInputs {
    fn slices(&self) -> MixtureSlices<'_> {
        let [values, widths, weight_logits, means, log_scales] = self.inputs.each_ref().map(HostTensor::as_slice);
        MixtureSlices { values, widths, weight_logits, means, log_scales }
    }
}

fn forward_on_cpu<B: HostBackend>(tensors: MixtureTensors<B>, bound: f32) -> (FloatTensor<B>, CpuInputs) {
    let inputs = CpuInputs { inputs: tensors.into_array().map(B::to_host), bound };
    let bits = bits_of_slices(&inputs.slices(), bound);
    let channels = bits.len();
    (B::from_values(bits, [channels]), inputs)
}

fn backward_on_cpu<B: HostBackend>(inputs: &CpuInputs, gradient: FloatTensor<B>) -> MixtureTensors<B> {
    let upstream = B::to_host(gradient);
    let channels = upstream.as_slice().len();
    let gradients = mixture_bits_backward(&inputs.slices(), inputs.bound, upstream.as_slice());
    let matrix = |values: Vec<f32>| {
        let columns = values.len() / channels.max(1);
        B::from_values(values, [channels, columns])
    };
    MixtureTensors {
        values: matrix(gradients.values),
        widths: matrix(gradients.widths),
        weight_logits: matrix(gradients.weight_logits),
        means: matrix(gradients.means),
        log_scales: matrix(gradients.log_scales),
    }
}

for_cpu_back_ends! {
    MixtureBitsKernels {
        type Inputs = CpuInputs;

        fn mixture_bits_forward(tensors: MixtureTensors<Self>, bound: f32) -> (FloatTensor<Self>, CpuInputs) {
            forward_on_cpu(tensors, bound)
        }

        fn mixture_bits_backward(inputs: CpuInputs, gradient: FloatTensor<Self>) -> MixtureTensors<Self> {
            backward_on_cpu(&inputs, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + MixtureBitsKernels> MixtureBitsKernels for Fusion<B> {
    type Inputs = B::Inputs;

    fn mixture_bits_forward(tensors: MixtureTensors<Self>, bound: f32) -> (FloatTensor<Self>, B::Inputs) {
        let tensors = MixtureTensors::from_array(tensors.into_array().map(resolve::<B>));
        let (bits, inputs) = B::mixture_bits_forward(tensors, bound);
        (leaf::<B>(bits), inputs)
    }

    fn mixture_bits_backward(inputs: B::Inputs, gradient: FloatTensor<Self>) -> MixtureTensors<Self> {
        let gradients = B::mixture_bits_backward(inputs, resolve::<B>(gradient));
        MixtureTensors::from_array(gradients.into_array().map(leaf::<B>))
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
/// use light4gs_model::ops::rate::mixture_bits::{MixtureInputs, mixture_bits};
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
