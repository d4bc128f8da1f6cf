//! A linear layer on many rows, as a Burn operation.
//!
//! Forward is Burn's own product. Backward, the gradient of the weights is a product whose inner dimension is the number of rows: a
//! few tiles of results, in each of which a GPU takes ten thousand steps one after the other (6 ms a layer on an H100, where forward
//! takes 0.03). So on a GPU it is split into parts, which are added up; the gradient of the bias likewise.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::nn::Linear;
#[cfg(feature = "wgpu")]
use burn::tensor::Slice;
use burn::tensor::{Shape, Tensor};
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
#[cfg(feature = "wgpu")]
use burn_wgpu::CubeBackend;

use super::{differentiate, for_all_back_ends, for_cpu_back_ends};

/// Rows of a part, unless there are so many parts then that adding them up takes longer than they save.
#[cfg(feature = "wgpu")]
const PART: usize = 128;
#[cfg(feature = "wgpu")]
const MOST_PARTS: usize = 256;

/// The differentiable inputs, or their gradients, in the order that gradients are registered in.
#[derive(ExtensionType)]
pub struct LinearTensors<B: Backend> {
    /// `[N, I]`.
    pub input: FloatTensor<B>,
    /// `[I, O]`.
    pub weight: FloatTensor<B>,
    /// `[O]`.
    pub bias: FloatTensor<B>,
}

/// A back end's gradient. [`LinearOps`] adds the dispatch and the tape.
pub trait LinearKernels: Backend {
    /// Gradients of input, weight and bias from that of the output `[N, O]`.
    fn linear_backward(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; 3];
}

/// The layer on every back end that has [`LinearKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait LinearOps: Backend {
    /// `[N, O]`; see [`linear`].
    fn linear_layer(#[extension_type] tensors: LinearTensors<Self>) -> FloatTensor<Self>;
}

fn forward<B: Backend>(tensors: LinearTensors<B>) -> FloatTensor<B> {
    let LinearTensors { input, weight, bias } = tensors;
    let (count, outputs) = (input.shape()[0], bias.shape()[0]);
    if count == 0 {
        // Burn's `ndarray` refuses products of nothing.
        return zeros::<B>(&bias, [0, outputs]);
    }
    B::float_add(B::float_matmul(input, weight), B::float_reshape(bias, Shape::from([1, outputs])))
}

fn zeros<B: Backend>(beside: &FloatTensor<B>, shape: [usize; 2]) -> FloatTensor<B> {
    B::float_zeros(Shape::from(shape), &beside.device(), beside.dtype().into())
}

/// `[I, O]`, the sum over all rows of the products of a row of `a [N, I]` and one of `b [N, O]`, and `[O]`, the sum of the rows of `b`.
fn sums_over_rows<B: Backend>(a: FloatTensor<B>, b: FloatTensor<B>) -> [FloatTensor<B>; 2] {
    let outputs = b.shape()[1];
    let of_bias = B::float_reshape(B::float_sum_dim(b.clone(), 0), Shape::from([outputs]));
    [B::float_matmul(B::float_transpose(a), b), of_bias]
}

/// The same, part by part.
#[cfg(feature = "wgpu")]
fn sums_over_parts<B: Backend>(a: FloatTensor<B>, b: FloatTensor<B>) -> [FloatTensor<B>; 2] {
    let (count, inputs, outputs) = (a.shape()[0], a.shape()[1], b.shape()[1]);
    let part = count.div_ceil(MOST_PARTS).max(PART);
    let parts = count / part;
    if parts < 2 {
        return sums_over_rows::<B>(a, b);
    }
    let rows = |tensor: &FloatTensor<B>, from: usize, to: usize| {
        if to - from == count {
            return tensor.clone();
        }
        B::float_slice(tensor.clone(), &[Slice::from(from..to), Slice::from(0..tensor.shape()[1])])
    };
    let whole = parts * part;
    let in_parts = |tensor: &FloatTensor<B>, columns| {
        B::float_reshape(rows(tensor, 0, whole), Shape::from([parts, part, columns]))
    };
    let (a_in_parts, b_in_parts) = (in_parts(&a, inputs), in_parts(&b, outputs));
    let of_bias = B::float_sum_dim(B::float_sum_dim(b_in_parts.clone(), 1), 0);
    let of_weight = B::float_sum_dim(B::float_matmul(B::float_transpose(a_in_parts), b_in_parts), 0);
    let sums = [
        B::float_reshape(of_weight, Shape::from([inputs, outputs])),
        B::float_reshape(of_bias, Shape::from([outputs])),
    ];
    if whole == count {
        return sums;
    }
    let mut rest = sums_over_rows::<B>(rows(&a, whole, count), rows(&b, whole, count)).into_iter();
    sums.map(|sum| B::float_add(sum, rest.next().expect("two sums")))
}

fn backward<B: Backend>(
    input: FloatTensor<B>,
    weight: FloatTensor<B>,
    gradient: FloatTensor<B>,
    sums: impl FnOnce(FloatTensor<B>, FloatTensor<B>) -> [FloatTensor<B>; 2],
) -> [FloatTensor<B>; 3] {
    let [count, inputs, outputs] = [input.shape()[0], weight.shape()[0], weight.shape()[1]];
    if count == 0 {
        let of_bias = B::float_reshape(zeros::<B>(&weight, [1, outputs]), Shape::from([outputs]));
        return [input, zeros::<B>(&weight, [inputs, outputs]), of_bias];
    }
    let of_input = B::float_matmul(gradient.clone(), B::float_transpose(weight));
    let [of_weight, of_bias] = sums(input, gradient);
    [of_input, of_weight, of_bias]
}

for_all_back_ends! {
    LinearOps with LinearKernels {
        fn linear_layer(tensors: LinearTensors<Self>) -> FloatTensor<Self> {
            forward(tensors)
        }
    }
}

for_cpu_back_ends! {
    LinearKernels {
        fn linear_backward(
            input: FloatTensor<Self>,
            weight: FloatTensor<Self>,
            gradient: FloatTensor<Self>,
        ) -> [FloatTensor<Self>; 3] {
            backward::<Self>(input, weight, gradient, sums_over_rows::<Self>)
        }
    }
}

#[cfg(feature = "wgpu")]
impl LinearKernels for CubeBackend {
    fn linear_backward(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; 3] {
        backward::<Self>(input, weight, gradient, sums_over_parts::<Self>)
    }
}

/// A fusion stream fuses these operations without our help.
#[cfg(feature = "wgpu")]
impl<B: FusionBackend> LinearKernels for Fusion<B> {
    fn linear_backward(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; 3] {
        backward::<Self>(input, weight, gradient, sums_over_parts::<Self>)
    }
}

impl<B: LinearOps + LinearKernels, C: CheckpointStrategy> LinearOps for Autodiff<B, C> {
    fn linear_layer(tensors: LinearTensors<Self>) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Layer;

        impl<B: LinearKernels> Backward<B, 3> for Layer {
            type State = [FloatTensor<B>; 2];

            fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |[input, weight], gradient| {
                    B::linear_backward(input, weight, gradient)
                });
            }
        }

        let tensors = [tensors.input, tensors.weight, tensors.bias];
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let [input, weight, bias] = tensors.map(|tensor| tensor.into_primitive());
        let saved = [input.clone(), weight.clone()];
        let output = B::linear_layer(LinearTensors { input, weight, bias });
        match Layer.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(saved, output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }
}

/// `[N, O]`: the product of each row of `input [N, I]` with `weight [I, O]`, plus `bias [O]`.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::linear::linear;
///
/// let device = Device::flex();
/// let input = Tensor::<2>::from_floats([[1.0, 2.0], [3.0, 4.0]], &device);
/// let weight = Tensor::<2>::from_floats([[1.0], [10.0]], &device);
/// let output = linear(input, weight, Tensor::from_floats([0.5], &device));
/// assert_eq!(output.into_data().to_vec::<f32>().unwrap(), [21.5, 43.5]);
/// ```
///
/// # Panics
/// If the shapes do not belong together; the message names the tensor.
pub fn linear(input: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    let [inputs, outputs] = weight.dims();
    assert_eq!(input.dims()[1], inputs, "input must be [N, I], as weight is [I, O]");
    assert_eq!(bias.dims(), [outputs], "bias must be [O]");
    Tensor::from_dispatch(Dispatch::linear_layer(LinearTensors {
        input: input.into_dispatch(),
        weight: weight.into_dispatch(),
        bias: bias.into_dispatch(),
    }))
}

/// [`linear`] with the parameters of a layer of Burn's, which has a bias.
///
/// # Panics
/// If the layer has no bias, or another number of inputs.
pub(crate) fn layer(linear_layer: &Linear, input: Tensor<2>) -> Tensor<2> {
    let bias = linear_layer.bias.as_ref().expect("a layer with a bias").val();
    linear(input, linear_layer.weight.val(), bias)
}
