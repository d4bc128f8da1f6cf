//! Rows of tables and their neighbors, as a Burn operation: attributes of Gaussians are predicted from these numbers.
//!
//! Burn has `select`, `mean_dim` and `cat`. On a GPU, the backward pass of `select` adds the chosen rows one after the other, one
//! invocation a column: thousands of steps that wait for each other; and joining and narrowing tensors are launches of their
//! own, two and more each. Here the host, which knows the rows, tells where each row was chosen, and every number of a table
//! adds up its own few, in one launch.

mod cpu;
#[cfg(feature = "wgpu")]
pub(super) mod gpu;

use std::any::Any;
use std::fmt::Debug;
use std::sync::{Arc, OnceLock};

use burn::backend::autodiff::checkpoint::strategy::CheckpointStrategy;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{FloatDType, Tensor};
use light4gs_codec::attributes::NEIGHBORS;

use super::tensor_list::TensorList;
use super::{for_all_back_ends, recorded};

/// Most tables of a call.
pub const MOST_TABLES: usize = 16;

/// Some rows of a table, in any order, and the [`NEIGHBORS`] neighbors of each, the nearest first. Cloning shares them.
#[derive(Clone, Debug)]
pub struct Neighborhoods(Arc<Chosen>);

/// The rows, and where each was chosen, worked out once for the forward and the backward pass.
#[derive(Debug)]
struct Chosen {
    /// The rows themselves, `M`, then `NEIGHBORS` neighbors for each.
    rows: Vec<u32>,
    /// Rows of the table.
    count: usize,
    /// The rows on a GPU: uploaded in the forward pass, used again in the backward pass.
    #[cfg_attr(not(feature = "wgpu"), allow(dead_code))]
    made: OnceLock<Box<dyn Any + Send + Sync>>,
    places: OnceLock<Places>,
}

/// Where each row of the table was chosen: the places of row `i` in [`Chosen::rows`] are
/// `places[starts[i]..starts[i + 1]]`, in ascending order.
#[derive(Debug)]
struct Places {
    /// One number more than there are rows in a table.
    starts: Vec<u32>,
    places: Vec<u32>,
}

impl Neighborhoods {
    /// These rows of a table with `count` rows, and the neighbors of each of them.
    ///
    /// # Panics
    /// If the table has no such row; if there are not neighbors for each row.
    pub fn new(rows: &[u32], neighbors: &[[u32; NEIGHBORS]], count: usize) -> Self {
        assert_eq!(rows.len(), neighbors.len(), "every row has neighbors");
        let rows = [rows, neighbors.as_flattened()].concat();
        let beyond = rows.iter().find(|&&row| row as usize >= count);
        assert_eq!(beyond, None, "a row beyond the {count} of the table");
        Self(Arc::new(Chosen { rows, count, made: OnceLock::new(), places: OnceLock::new() }))
    }
}

impl Chosen {
    /// Number of chosen rows, `M`.
    fn len(&self) -> usize {
        self.rows.len() / (1 + NEIGHBORS)
    }

    fn places(&self) -> &Places {
        self.places.get_or_init(|| {
            let mut starts = vec![0; self.count + 1];
            for &row in &self.rows {
                starts[row as usize + 1] += 1;
            }
            for row in 0..self.count {
                starts[row + 1] += starts[row];
            }
            let mut next = starts.clone();
            let mut places = vec![0; self.rows.len()];
            for (place, &row) in self.rows.iter().enumerate() {
                let to = &mut next[row as usize];
                places[*to as usize] = place as u32;
                *to += 1;
            }
            Places { starts, places }
        })
    }
}

/// A back end's kernels. [`NeighborhoodsOps`] adds the dispatch and the
/// tape.
pub trait NeighborhoodsKernels: Backend {
    /// `[3 C, M]` of tables with N rows and C columns together: a column for each chosen row, with its own numbers, the means over
    /// its neighbors and the numbers of the nearest one.
    fn neighborhoods_forward(tables: TensorList<Self>, chosen: &Neighborhoods) -> FloatTensor<Self>;

    /// The gradients of the tables, which have these numbers of columns, from that of the result `[3 C, M]`.
    fn neighborhoods_backward(
        chosen: &Neighborhoods,
        widths: &[usize],
        gradient: FloatTensor<Self>,
    ) -> TensorList<Self>;
}

/// The operation on every back end that has [`NeighborhoodsKernels`], differentiable under [`Autodiff`].
#[backend_extension(
    NdArray: cfg(feature = "ndarray"), Flex: cfg(feature = "flex"), Cube: cfg(feature = "wgpu"), Autodiff
)]
pub trait NeighborhoodsOps: Backend {
    /// `[3 C, M]` of [`MOST_TABLES`] tables, some of them without columns; see [`neighborhoods`].
    fn neighborhoods(#[extension_type] tables: TensorList<Self>, chosen: Neighborhoods) -> FloatTensor<Self>;
}

for_all_back_ends! {
    NeighborhoodsOps with NeighborhoodsKernels {
        fn neighborhoods(tables: TensorList<Self>, chosen: Neighborhoods) -> FloatTensor<Self> {
            Self::neighborhoods_forward(with_columns(tables), &chosen)
        }
    }
}

/// The tables that have columns.
fn with_columns<B: Backend>(tables: TensorList<B>) -> TensorList<B> {
    TensorList(tables.0.into_iter().filter(|table| table.shape()[1] > 0).collect())
}

impl<B: NeighborhoodsOps + NeighborhoodsKernels, C: CheckpointStrategy> NeighborhoodsOps for Autodiff<B, C> {
    fn neighborhoods(tables: TensorList<Self>, chosen: Neighborhoods) -> FloatTensor<Self> {
        let tables: [FloatTensor<Self>; MOST_TABLES] =
            tables.0.try_into().unwrap_or_else(|tables: Vec<_>| panic!("{} tables", tables.len()));
        let nodes = tables.each_ref().map(|table| table.node());
        let tables = tables.map(|table| table.into_primitive());
        let shapes = tables.each_ref().map(|table| table.shape());
        let result = B::neighborhoods_forward(with_columns(TensorList(tables.into())), &chosen);
        recorded::<B, C, _, _>(nodes, (result, (chosen, shapes)), |(chosen, shapes), gradient| {
            let device = gradient.device();
            let widths: Vec<usize> = shapes.iter().map(|shape| shape[1]).filter(|width| *width > 0).collect();
            let mut gradients = B::neighborhoods_backward(&chosen, &widths, gradient).0.into_iter();
            shapes.map(|shape| match shape[1] {
                0 => B::float_zeros(shape, &device, FloatDType::F32),
                _ => gradients.next().expect("a gradient for each table"),
            })
        })
    }
}

/// Some rows of tables, which have N rows and C columns together, and their neighbors, each as a column of the result `[3 C, M]`:
/// the numbers of the row, the means over its neighbors, the numbers of the nearest one.
///
/// ```
/// use burn::tensor::{Device, Tensor};
/// use light4gs_model::ops::neighborhoods::{Neighborhoods, neighborhoods};
///
/// let device = Device::flex().autodiff();
/// let table = Tensor::<2>::from_floats([[1.0], [2.0], [4.0]], &device).require_grad();
/// let chosen = Neighborhoods::new(&[0, 2], &[[1, 2, 2, 2], [1, 0, 0, 0]], 3);
/// let columns = neighborhoods(vec![table.clone()], chosen);
/// assert_eq!(columns.clone().into_data().to_vec::<f32>().unwrap(), [1.0, 4.0, 3.5, 1.25, 2.0, 2.0]);
/// // The first row counts for itself, and for three of the four neighbors of the last.
/// let gradient = table.grad(&columns.sum().backward()).unwrap();
/// assert_eq!(gradient.into_data().to_vec::<f32>().unwrap(), [1.75, 2.5, 1.75]);
/// ```
///
/// # Panics
/// If there is no table with a column, or there are more than [`MOST_TABLES`]; if the rows are of tables with another number of rows.
pub fn neighborhoods(tables: Vec<Tensor<2>>, chosen: Neighborhoods) -> Tensor<2> {
    let (count, device) = (tables.len(), tables.first().expect("a table or more").device());
    assert!(count <= MOST_TABLES, "{count} tables, and {MOST_TABLES} at most");
    let rows = |table: &Tensor<2>| table.dims()[0];
    assert!(tables.iter().all(|table| rows(table) == chosen.0.count), "the rows were chosen for other tables");
    // The tape takes a fixed number of them.
    let nothing = std::iter::repeat_with(|| Tensor::empty([chosen.0.count, 0], &device));
    let tables = tables.into_iter().chain(nothing.take(MOST_TABLES - count)).map(Tensor::into_dispatch).collect();
    Tensor::from_dispatch(Dispatch::neighborhoods(TensorList(tables), chosen.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_rows() {
        let chosen = Neighborhoods::new(&[2], &[[0, 2, 3, 2]], 5);
        assert_eq!(chosen.0.len(), 1);
        let Places { starts, places } = chosen.0.places();
        assert_eq!(starts, &[0, 1, 1, 4, 5, 5]);
        assert_eq!(places, &[1, 0, 2, 4, 3]);
    }

    #[test]
    #[should_panic(expected = "a row beyond the 3 of the table")]
    fn no_row_beyond_the_table() {
        Neighborhoods::new(&[0], &[[1, 2, 3, 0]], 3);
    }

    #[test]
    #[should_panic(expected = "every row has neighbors")]
    fn no_row_without_neighbors() {
        Neighborhoods::new(&[0, 1], &[[0; NEIGHBORS]], 3);
    }
}
