//! Some columns of a matrix, as a Burn operation: the backward pass puts them in their place among zeros in one kernel, where
//! Burn's slices take two.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::ops::Range;

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Slice, Tensor};

use super::{for_all_back_ends, recorded};

/// A back end's gradient. [`ColumnsOps`] adds the dispatch and the tape.
pub trait ColumnsKernels: Backend {
    /// A matrix `[R, width]` with these columns, from `first` on, and zeros elsewhere.
    fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self>;
}

/// The columns on every back end that has [`ColumnsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait ColumnsOps: Backend {
    /// Columns `first..end` of a matrix.
    fn columns(matrix: FloatTensor<Self>, first: usize, end: usize) -> FloatTensor<Self>;
}

for_all_back_ends! {
    ColumnsOps with ColumnsKernels {
        fn columns(matrix: FloatTensor<Self>, first: usize, end: usize) -> FloatTensor<Self> {
            let rows = Slice::new(0, None, 1);
            Self::float_slice(matrix, &[rows, Slice::new(first as isize, Some(end as isize), 1)])
        }
    }
}

impl<B: ColumnsOps + ColumnsKernels, C: CheckpointStrategy> ColumnsOps for Autodiff<B, C> {
    fn columns(matrix: FloatTensor<Self>, first: usize, end: usize) -> FloatTensor<Self> {
        let node = matrix.node();
        let matrix = matrix.into_primitive();
        let width = matrix.shape()[1];
        let columns = B::columns(matrix, first, end);
        recorded::<B, C, _, _>([node], (columns, (first, width)), |(first, width), gradient| {
            [B::place_columns(gradient, first, width)]
        })
    }
}

/// Some columns of a matrix `[R, W]`.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::columns::columns;
///
/// let device = Device::flex().autodiff();
/// let matrix = Tensor::<2>::from_floats([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], &device).require_grad();
/// let two = columns(matrix.clone(), 1..3);
/// assert_eq!(two.clone().into_data().to_vec::<f32>().unwrap(), [2.0, 3.0, 5.0, 6.0]);
/// let gradient = matrix.grad(&two.sum().backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [0.0, 1.0, 1.0, 0.0, 1.0, 1.0]);
/// ```
///
/// # Panics
/// If the matrix has fewer columns than the range asks for.
pub fn columns(matrix: Tensor<2>, range: Range<usize>) -> Tensor<2> {
    let [_, width] = matrix.dims();
    assert!(range.start <= range.end && range.end <= width, "columns {range:?} of a matrix with {width}");
    Tensor::from_dispatch(Dispatch::columns(matrix.into_dispatch(), range.start, range.end))
}
