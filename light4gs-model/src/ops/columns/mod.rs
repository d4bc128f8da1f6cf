//! Some columns of a matrix, as a Burn operation: the backward pass puts them in their place among zeros in one kernel, where
//! Burn's slices take two.

use std::ops::Range;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Slice, Tensor};
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};
#[cfg(feature = "wgpu")]
use burn_wgpu::CubeBackend;

#[cfg(feature = "wgpu")]
use super::fusion::{leaf, resolve};
use super::host::HostBackend;
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
#[cfg(feature = "wgpu")]
use crate::gpu::place_columns_on_gpu;

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

fn placed_on_cpu<B: HostBackend>(columns: FloatTensor<B>, first: usize, width: usize) -> FloatTensor<B> {
    let [rows, count] = columns.shape().dims();
    let mut placed = vec![0.0; rows * width];
    if count > 0 {
        let columns = B::to_host(columns);
        for (row, own) in placed.chunks_exact_mut(width).zip(columns.as_slice().chunks_exact(count)) {
            row[first..first + count].copy_from_slice(own);
        }
    }
    B::from_values(placed, [rows, width])
}

for_cpu_back_ends! {
    ColumnsKernels {
        fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self> {
            placed_on_cpu::<Self>(columns, first, width)
        }
    }
}

#[cfg(feature = "wgpu")]
impl ColumnsKernels for CubeBackend {
    fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self> {
        place_columns_on_gpu(columns, first, width)
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + ColumnsKernels> ColumnsKernels for Fusion<B> {
    fn place_columns(columns: FloatTensor<Self>, first: usize, width: usize) -> FloatTensor<Self> {
        leaf::<B>(B::place_columns(resolve::<B>(columns), first, width))
    }
}

impl<B: ColumnsOps + ColumnsKernels, C: CheckpointStrategy> ColumnsOps for Autodiff<B, C> {
    fn columns(matrix: FloatTensor<Self>, first: usize, end: usize) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Columns;

        impl<B: ColumnsKernels> Backward<B, 1> for Columns {
            /// The first column, and the width of the matrix.
            type State = (usize, usize);

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |(first, width), gradient| {
                    [B::place_columns(gradient, first, width)]
                });
            }
        }

        let node = matrix.node();
        let matrix = matrix.into_primitive();
        let width = matrix.shape()[1];
        let columns = B::columns(matrix, first, end);
        match Columns.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((first, width), columns),
            OpsKind::UnTracked(prep) => prep.finish(columns),
        }
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
/// If there are not so many columns.
pub fn columns(matrix: Tensor<2>, range: Range<usize>) -> Tensor<2> {
    let [_, width] = matrix.dims();
    assert!(range.start <= range.end && range.end <= width, "columns {range:?} of a matrix with {width}");
    Tensor::from_dispatch(Dispatch::columns(matrix.into_dispatch(), range.start, range.end))
}
