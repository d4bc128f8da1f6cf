//! Rows of a table: which ones, and what a back end does with them.

use std::fmt::Debug;
use std::sync::Arc;

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;

/// Rows of a table of `count` rows, in any order; a row may be chosen several times.
#[derive(Clone, Debug)]
pub struct ChosenRows {
    pub(crate) rows: Arc<[u32]>,
    pub(crate) count: usize,
}

impl ChosenRows {
    /// These rows of a table with `count` rows.
    ///
    /// # Panics
    /// If the table has no such row.
    pub fn new(rows: Vec<u32>, count: usize) -> Self {
        let beyond = rows.iter().find(|&&row| row as usize >= count);
        assert_eq!(beyond, None, "a row beyond the {count} of the table");
        Self { rows: rows.into(), count }
    }

    /// How many are chosen.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Where each row of the table was chosen: the places of row `i` are `places[starts[i]..starts[i + 1]]`, in ascending
    /// order. `starts` has `count + 1` numbers.
    pub(crate) fn places(&self) -> (Vec<u32>, Vec<u32>) {
        let mut starts = vec![0; self.count + 1];
        for &row in self.rows.iter() {
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
        (starts, places)
    }
}

/// A back end's kernels. [`GatherRowsOps`](crate::ops::gather_rows::GatherRowsOps) adds the dispatch and the tape.
pub trait GatherRowsKernels: Backend {
    /// What the backward pass wants to see again.
    type Chosen: Clone + Debug + Send + 'static;

    /// `[M, C]` of `table [N, C]`.
    fn gather_rows_forward(table: FloatTensor<Self>, rows: ChosenRows) -> (FloatTensor<Self>, Self::Chosen);

    /// The gradient of the table `[N, C]` from that of the rows `[M, C]`.
    fn gather_rows_backward(chosen: Self::Chosen, gradient: FloatTensor<Self>) -> FloatTensor<Self>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_rows() {
        let (starts, places) = ChosenRows::new(vec![2, 0, 2, 3, 2], 5).places();
        assert_eq!(starts, [0, 1, 1, 4, 5, 5]);
        assert_eq!(places, [1, 0, 2, 4, 3]);
    }

    #[test]
    #[should_panic(expected = "a row beyond the 3 of the table")]
    fn no_row_beyond_the_table() {
        ChosenRows::new(vec![0, 3], 3);
    }
}
