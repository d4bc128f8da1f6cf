//! Rows of tables: which ones, and what a back end does with them.

// Only a GPU asks where each row was chosen.
#![cfg_attr(not(feature = "wgpu"), allow(dead_code))]

use std::any::Any;
use std::fmt::Debug;
use std::sync::{Arc, OnceLock};

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;

/// Rows of tables with `count` rows, in any order; a row may be chosen several times. Cloning shares them.
#[derive(Clone, Debug)]
pub struct ChosenRows(pub(crate) Arc<Chosen>);

/// What is worked out once for all tables.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) rows: Vec<u32>,
    pub(crate) count: usize,
    /// What the first back end makes of the rows, to find it again for the next table.
    pub(crate) made: OnceLock<Box<dyn Any + Send + Sync>>,
    places: OnceLock<Places>,
}

/// Where each row was chosen: the places of row `i` are `places[starts[i]..starts[i + 1]]`, in ascending order.
#[derive(Debug)]
pub(crate) struct Places {
    /// One number more than there are rows in a table.
    pub(crate) starts: Vec<u32>,
    pub(crate) places: Vec<u32>,
}

impl ChosenRows {
    /// These rows of tables with `count` rows.
    ///
    /// # Panics
    /// If the tables have no such row.
    pub fn new(rows: Vec<u32>, count: usize) -> Self {
        let beyond = rows.iter().find(|&&row| row as usize >= count);
        assert_eq!(beyond, None, "a row beyond the {count} of the table");
        Self(Arc::new(Chosen { rows, count, made: OnceLock::new(), places: OnceLock::new() }))
    }
}

impl Chosen {
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

/// A back end's kernels. [`GatherRowsOps`](crate::ops::rate::gather_rows::GatherRowsOps) adds the dispatch and the tape.
pub trait GatherRowsKernels: Backend {
    /// `[C, M]` of `table [N, C]`: a column for each chosen row.
    fn gather_rows_forward(table: FloatTensor<Self>, rows: &ChosenRows) -> FloatTensor<Self>;

    /// The gradient of the table `[N, C]` from that of the result `[C, M]`.
    fn gather_rows_backward(rows: &ChosenRows, gradient: FloatTensor<Self>) -> FloatTensor<Self>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_rows() {
        let rows = ChosenRows::new(vec![2, 0, 2, 3, 2], 5);
        let Places { starts, places } = rows.0.places();
        assert_eq!(starts, &[0, 1, 1, 4, 5, 5]);
        assert_eq!(places, &[1, 0, 2, 4, 3]);
    }

    #[test]
    #[should_panic(expected = "a row beyond the 3 of the table")]
    fn no_row_beyond_the_table() {
        ChosenRows::new(vec![0, 3], 3);
    }
}
