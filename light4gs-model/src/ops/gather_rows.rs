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
use super::fusion::{leaf, resolve};
use super::host::HostBackend;
use super::{differentiate, for_all_back_ends, for_cpu_back_ends};
pub use crate::kernels::gather_rows::{ChosenRows, GatherRowsKernels};

/// The rows on every back end that has [`GatherRowsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait GatherRowsOps: Backend {
    /// `[M, C]`; see [`gather_rows`].
    fn gather_rows(table: FloatTensor<Self>, rows: ChosenRows) -> FloatTensor<Self>;
}

for_all_back_ends! {
    GatherRowsOps with GatherRowsKernels {
        fn gather_rows(table: FloatTensor<Self>, rows: ChosenRows) -> FloatTensor<Self> {
            Self::gather_rows_forward(table, rows).0
        }
    }
}

impl<B: GatherRowsOps + GatherRowsKernels, C: CheckpointStrategy> GatherRowsOps for Autodiff<B, C> {
    fn gather_rows(table: FloatTensor<Self>, rows: ChosenRows) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct GatherRows;

        impl<B: GatherRowsKernels> Backward<B, 1> for GatherRows {
            type State = B::Chosen;

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |chosen, gradient| [B::gather_rows_backward(chosen, gradient)]);
            }
        }

        let node = table.node();
        let (gathered, chosen) = B::gather_rows_forward(table.into_primitive(), rows);
        match GatherRows.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(chosen, gathered),
            OpsKind::UnTracked(prep) => prep.finish(gathered),
        }
    }
}

fn forward_on_cpu<B: HostBackend>(table: FloatTensor<B>, rows: ChosenRows) -> (FloatTensor<B>, ChosenRows) {
    let columns = table.shape()[1];
    let table = B::to_host(table);
    let row = |row: &u32| &table.as_slice()[*row as usize * columns..(*row as usize + 1) * columns];
    let gathered = rows.rows.iter().flat_map(row).copied().collect();
    (B::from_values(gathered, [rows.len(), columns]), rows)
}

fn backward_on_cpu<B: HostBackend>(rows: ChosenRows, gradient: FloatTensor<B>) -> FloatTensor<B> {
    let columns = gradient.shape()[1];
    let gradient = B::to_host(gradient);
    let mut sums = vec![0.0; rows.count * columns];
    for (place, row) in rows.rows.iter().map(|row| *row as usize).enumerate() {
        let upstream = &gradient.as_slice()[place * columns..(place + 1) * columns];
        sums[row * columns..(row + 1) * columns].iter_mut().zip(upstream).for_each(|(sum, value)| *sum += value);
    }
    B::from_values(sums, [rows.count, columns])
}

for_cpu_back_ends! {
    GatherRowsKernels {
        type Chosen = ChosenRows;

        fn gather_rows_forward(table: FloatTensor<Self>, rows: ChosenRows) -> (FloatTensor<Self>, ChosenRows) {
            forward_on_cpu::<Self>(table, rows)
        }

        fn gather_rows_backward(chosen: ChosenRows, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
            backward_on_cpu::<Self>(chosen, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + GatherRowsKernels> GatherRowsKernels for Fusion<B> {
    type Chosen = B::Chosen;

    fn gather_rows_forward(table: FloatTensor<Self>, rows: ChosenRows) -> (FloatTensor<Self>, B::Chosen) {
        let (gathered, chosen) = B::gather_rows_forward(resolve::<B>(table), rows);
        (leaf::<B>(gathered), chosen)
    }

    fn gather_rows_backward(chosen: B::Chosen, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::gather_rows_backward(chosen, resolve::<B>(gradient)))
    }
}

/// Rows `[M, C]` of a table `[N, C]`.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::gather_rows::{ChosenRows, gather_rows};
///
/// let device = Device::flex().autodiff();
/// let table = Tensor::<2>::from_floats([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], &device).require_grad();
/// let rows = gather_rows(table.clone(), ChosenRows::new(vec![2, 0, 2], 3));
/// assert_eq!(rows.clone().into_data().to_vec::<f32>().unwrap(), [5.0, 6.0, 1.0, 2.0, 5.0, 6.0]);
/// // The last row counts twice, that in the middle not at all.
/// let gradient = table.grad(&rows.sum().backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [1.0, 1.0, 0.0, 0.0, 2.0, 2.0]);
/// ```
///
/// # Panics
/// If the rows are of a table with another number of rows.
pub fn gather_rows(table: Tensor<2>, rows: ChosenRows) -> Tensor<2> {
    assert_eq!(table.dims()[0], rows.count, "the rows were chosen for another table");
    Tensor::from_dispatch(Dispatch::gather_rows(table.into_dispatch(), rows))
}
