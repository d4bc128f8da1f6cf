//! What some rows of a table are predicted from, as a Burn operation: their own numbers and those of their neighbors.
//!
//! Burn has `select`, `mean_dim` and `cat`. On a GPU, the backward pass of `select` adds the chosen rows one after the other, one
//! invocation a column: thousands of steps that wait for each other; and joining and narrowing tensors are launches of their
//! own, two and more each. Here the host, which knows the rows, tells where each row was chosen, and every number of the table
//! adds up its own few, in one launch.

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
use crate::cpu::neighborhoods as cpu;
pub use crate::kernels::neighborhoods::{Neighborhoods, NeighborhoodsKernels};

/// The operation on every back end that has [`NeighborhoodsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NeighborhoodsOps: Backend {
    /// `[3 C, M]`; see [`neighborhoods`].
    fn neighborhoods(table: FloatTensor<Self>, chosen: Neighborhoods) -> FloatTensor<Self>;
}

for_all_back_ends! {
    NeighborhoodsOps with NeighborhoodsKernels {
        fn neighborhoods(table: FloatTensor<Self>, chosen: Neighborhoods) -> FloatTensor<Self> {
            Self::neighborhoods_forward(table, &chosen)
        }
    }
}

impl<B: NeighborhoodsOps + NeighborhoodsKernels, C: CheckpointStrategy> NeighborhoodsOps for Autodiff<B, C> {
    fn neighborhoods(table: FloatTensor<Self>, chosen: Neighborhoods) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct OfTable;

        impl<B: NeighborhoodsKernels> Backward<B, 1> for OfTable {
            type State = Neighborhoods;

            fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
                differentiate::<B, _, _>(ops, grads, |chosen, gradient| [B::neighborhoods_backward(&chosen, gradient)]);
            }
        }

        let node = table.node();
        let result = B::neighborhoods_forward(table.into_primitive(), &chosen);
        match OfTable.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(chosen, result),
            OpsKind::UnTracked(prep) => prep.finish(result),
        }
    }
}

fn forward_on_cpu<B: HostBackend>(table: FloatTensor<B>, chosen: &Neighborhoods) -> FloatTensor<B> {
    let columns = table.shape()[1];
    let result = cpu::forward(B::to_host(table).as_slice(), columns, &chosen.0);
    B::from_values(result, [3 * columns, chosen.0.len()])
}

fn backward_on_cpu<B: HostBackend>(chosen: &Neighborhoods, gradient: FloatTensor<B>) -> FloatTensor<B> {
    let columns = gradient.shape()[0] / 3;
    let sums = cpu::backward(B::to_host(gradient).as_slice(), columns, &chosen.0);
    B::from_values(sums, [chosen.0.count, columns])
}

for_cpu_back_ends! {
    NeighborhoodsKernels {
        fn neighborhoods_forward(table: FloatTensor<Self>, chosen: &Neighborhoods) -> FloatTensor<Self> {
            forward_on_cpu::<Self>(table, chosen)
        }

        fn neighborhoods_backward(chosen: &Neighborhoods, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
            backward_on_cpu::<Self>(chosen, gradient)
        }
    }
}

#[cfg(feature = "wgpu")]
impl<B: FusionBackend + NeighborhoodsKernels> NeighborhoodsKernels for Fusion<B> {
    fn neighborhoods_forward(table: FloatTensor<Self>, chosen: &Neighborhoods) -> FloatTensor<Self> {
        leaf::<B>(B::neighborhoods_forward(resolve::<B>(table), chosen))
    }

    fn neighborhoods_backward(chosen: &Neighborhoods, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        leaf::<B>(B::neighborhoods_backward(chosen, resolve::<B>(gradient)))
    }
}

/// Some rows of a table `[N, C]` and their neighbors, each as a column of the result `[3 C, M]`: the numbers of the row, the
/// means over its neighbors, the numbers of the nearest one.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::rate::neighborhoods::{Neighborhoods, neighborhoods};
///
/// let device = Device::flex().autodiff();
/// let table = Tensor::<2>::from_floats([[1.0], [2.0], [4.0]], &device).require_grad();
/// let columns = neighborhoods(table.clone(), Neighborhoods::new(&[0, 2], &[[1, 2, 2, 2], [1, 0, 0, 0]], 3));
/// assert_eq!(columns.clone().into_data().to_vec::<f32>().unwrap(), [1.0, 4.0, 3.5, 1.25, 2.0, 2.0]);
/// // The first row counts for itself, and for three of the four neighbors of the last.
/// let gradient = table.grad(&columns.sum().backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [1.75, 2.5, 1.75]);
/// ```
///
/// # Panics
/// If the rows are of a table with another number of rows.
pub fn neighborhoods(table: Tensor<2>, chosen: Neighborhoods) -> Tensor<2> {
    assert_eq!(table.dims()[0], chosen.0.count, "the rows were chosen for another table");
    Tensor::from_dispatch(Dispatch::neighborhoods(table.into_dispatch(), chosen))
}
