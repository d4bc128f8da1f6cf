//! What the rows of a table and of their neighbors say: which rows, and what a back end does with them.

use std::any::Any;
use std::fmt::Debug;
use std::sync::{Arc, OnceLock};

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;
use light4gs_codec::attributes::NEIGHBORS;

/// Some rows of a table, in any order, and the [`NEIGHBORS`] neighbors of each, the nearest first. Cloning shares them.
#[derive(Clone, Debug)]
pub struct Neighborhoods(pub(crate) Arc<Chosen>);

/// What is worked out once for the forward and the backward pass.
#[derive(Debug)]
pub(crate) struct Chosen {
    /// The rows themselves, `M`, then `NEIGHBORS` neighbors for each.
    pub(crate) rows: Vec<u32>,
    /// Rows of the table.
    pub(crate) count: usize,
    /// What a GPU makes of the rows in the forward pass, for the backward pass.
    #[cfg_attr(not(feature = "wgpu"), allow(dead_code))]
    pub(crate) made: OnceLock<Box<dyn Any + Send + Sync>>,
    places: OnceLock<Places>,
}

/// Where each row of the table was chosen: the places of row `i` in [`Chosen::rows`] are
/// `places[starts[i]..starts[i + 1]]`, in ascending order.
#[derive(Debug)]
pub(crate) struct Places {
    /// One number more than there are rows in a table.
    pub(crate) starts: Vec<u32>,
    pub(crate) places: Vec<u32>,
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
    /// How many rows were chosen, `M`.
    pub(crate) fn len(&self) -> usize {
        self.rows.len() / (1 + NEIGHBORS)
    }

    pub(crate) fn places(&self) -> &Places {
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

/// A back end's kernels. [`NeighborhoodsOps`](crate::ops::rate::neighborhoods::NeighborhoodsOps) adds the dispatch and the
/// tape.
pub trait NeighborhoodsKernels: Backend {
    /// `[3 C, M]` of `table [N, C]`: a column for each chosen row, with its own numbers, the means over its neighbors and
    /// the numbers of the nearest one.
    fn neighborhoods_forward(table: FloatTensor<Self>, chosen: &Neighborhoods) -> FloatTensor<Self>;

    /// The gradient of the table `[N, C]` from that of the result `[3 C, M]`.
    fn neighborhoods_backward(chosen: &Neighborhoods, gradient: FloatTensor<Self>) -> FloatTensor<Self>;
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
