//! Rows of a table, as a Burn operation.
//!
//! Burn has `select`. On a GPU, its backward pass adds the chosen rows one after the other, one invocation a column: thousands of
//! steps that wait for each other. Here the host, which knows the rows, tells where each row was chosen, and every number of the
//! table adds up its own few.

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
#[cfg(feature = "wgpu")]
use burn_fusion::{Fusion, FusionBackend};

#[cfg(feature = "wgpu")]
use super::super::fusion::{leaf, resolve};
use super::super::host::HostBackend;
use super::super::{differentiate, for_all_back_ends, for_cpu_back_ends};
pub use crate::kernels::gather_rows::{ChosenRows, GatherRowsKernels};

/// The rows on every back end that has [`GatherRowsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait GatherRowsOps: Backend {
    /// `[C, M]`; see [`gather_rows`].
    fn gather_rows(table: FloatTensor<Self>, rows: ChosenRows) -> FloatTensor<Self>;
}

for_all_back_ends! {
    GatherRowsOps with GatherRowsKernels {
        fn gather_rows(table: FloatTensor<Self>, rows: ChosenRows) -> FloatTensor<Self> {
            Self::gather_rows_forward(table, &rows)
        }
    }
}

impl<B: GatherRowsOps + GatherRowsKernels, C: CheckpointStrategy> GatherRowsOps for Autodiff<B, C> {
    fn gather_rows(table: FloatTensor<Self>, rows: ChosenRows) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct GatherRows;

        impl<B: GatherRowsKernels> Backward<B, 1> for GatherRows {
            type State = ChosenRows;

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |rows, gradient| [B::gather_rows_backward(&rows, gradient)]);
            }
        }

        let node = table.node();
        let gathered = B::gather_rows_forward(table.into_primitive(), &rows);
        match GatherRows.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(rows, gathered),
            OpsKind::UnTracked(prep) => prep.finish(gathered),
        }
    }
}

fn forward_on_cpu<B: HostBackend>(table: FloatTensor<B>, rows: &ChosenRows) -> FloatTensor<B> {
    let columns = table.shape()[1];
    let table = B::to_host(table);
    let values = table.as_slice();
    let rows = &rows.0.rows;
    let mut gathered = Vec::with_capacity(rows.len() * columns);
    for column in 0..columns {
        gathered.extend(rows.iter().map(|row| values[*row as usize * columns + column]));
    }
    B::from_values(gathered, [columns, rows.len()])
}

fn backward_on_cpu<B: HostBackend>(rows: &ChosenRows, gradient: FloatTensor<B>) -> FloatTensor<B> {
    let columns = gradient.shape()[0];
    let gradient = B::to_host(gradient);
    let (rows, count) = (&rows.0.rows, rows.0.count);
    let mut sums = vec![0.0; count * columns];
    for (column, upstream) in gradient.as_slice().chunks_exact(rows.len().max(1)).enumerate() {
        for (row, value) in rows.iter().zip(upstream) {
            sums[*row as usize * columns + column] += value;
        }
    }
    B::from_values(sums, [count, columns])
}

for_cpu_back_ends! {
    GatherRowsKernels {
        fn gather_rows_forward(table: FloatTensor<Self>, rows: &ChosenRows) -> FloatTensor<Self> {
            forward_on_cpu::<Self>(table, rows)
        }

        fn gather_rows_backward(rows: &ChosenRows, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
            backward_on_cpu::<Self>(rows, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + GatherRowsKernels> GatherRowsKernels for Fusion<B> {
    fn gather_rows_forward(table: FloatTensor<Self>, rows: &ChosenRows) -> FloatTensor<Self> {
        leaf::<B>(B::gather_rows_forward(resolve::<B>(table), rows))
    }

    fn gather_rows_backward(rows: &ChosenRows, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::gather_rows_backward(rows, resolve::<B>(gradient)))
    }
}

/// Rows of a table `[N, C]`, each as a column of the result `[C, M]`.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::rate::gather_rows::{ChosenRows, gather_rows};
///
/// let device = Device::flex().autodiff();
/// let table = Tensor::<2>::from_floats([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], &device).require_grad();
/// let columns = gather_rows(table.clone(), ChosenRows::new(vec![2, 0, 2], 3));
/// assert_eq!(columns.clone().into_data().to_vec::<f32>().unwrap(), [5.0, 1.0, 5.0, 6.0, 2.0, 6.0]);
/// // The last row counts twice, that in the middle not at all.
/// let gradient = table.grad(&columns.sum().backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [1.0, 1.0, 0.0, 0.0, 2.0, 2.0]);
/// ```
///
/// # Panics
/// If the rows are of a table with another number of rows.
pub fn gather_rows(table: Tensor<2>, rows: ChosenRows) -> Tensor<2> {
    assert_eq!(table.dims()[0], rows.0.count, "the rows were chosen for another table");
    Tensor::from_dispatch(Dispatch::gather_rows(table.into_dispatch(), rows))
}
