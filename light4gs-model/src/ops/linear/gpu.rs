//! The gradients of a linear layer on a GPU, in parts that are added up.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Slice};
use burn_fusion::{Fusion, FusionBackend};
use burn_wgpu::CubeBackend;

use super::{LinearKernels, backward, sums_over_rows};

/// Rows of a part. Where this makes more than [`MOST_PARTS`], whose sums would take longer than they save, parts are longer.
const PART: usize = 128;
const MOST_PARTS: usize = 256;

/// [`sums_over_rows`], part by part.
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
impl<B: FusionBackend> LinearKernels for Fusion<B> {
    fn linear_backward(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
    ) -> [FloatTensor<Self>; 3] {
        backward::<Self>(input, weight, gradient, sums_over_parts::<Self>)
    }
}
