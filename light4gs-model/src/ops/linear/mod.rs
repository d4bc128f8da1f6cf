//! A linear layer on many rows, as a Burn operation.
//!
//! Forward is Burn's own product. Backward, the gradient of the weights is a product whose inner dimension is the number of rows: a
//! few tiles of results, in each of which a GPU takes ten thousand steps one after the other (6 ms a layer on an H100, where forward
//! takes 0.03). So on a GPU it is split into parts, which are added up; the gradient of the bias likewise.

mod cpu;
#[cfg(feature = "wgpu")]
mod gpu;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, ExtensionType, TensorMetadata, backend_extension};
use burn::nn::Linear;
use burn::tensor::{Shape, Tensor};

use super::{for_all_back_ends, recorded};

/// The differentiable inputs, or their gradients, in the order in which gradients are registered.
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

impl<B: LinearOps + LinearKernels, C: CheckpointStrategy> LinearOps for Autodiff<B, C> {
    fn linear_layer(tensors: LinearTensors<Self>) -> FloatTensor<Self> {
        let tensors = [tensors.input, tensors.weight, tensors.bias];
        let nodes = tensors.each_ref().map(|tensor| tensor.node());
        let [input, weight, bias] = tensors.map(|tensor| tensor.into_primitive());
        let saved = [input.clone(), weight.clone()];
        let output = B::linear_layer(LinearTensors { input, weight, bias });
        recorded::<B, C, _, _>(nodes, (output, saved), |[input, weight], gradient| {
            B::linear_backward(input, weight, gradient)
        })
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
