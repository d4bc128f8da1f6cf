//! Changes to the set of Gaussians, in which the optimizer's moments follow.

use burn::tensor::{Int, Tensor, TensorData};
use light4gs_model::{Attribute, AttributeMapper, GaussianTensors, Gaussians};

use crate::optimization::adam::Adam;

/// The Gaussians of a run while their number changes: every edit moves the optimizer's rows as well.
#[derive(Debug)]
pub struct GaussianEditor<'a> {
    gaussians: &'a mut Gaussians,
    adam: &'a mut Adam,
}

impl<'a> GaussianEditor<'a> {
    /// Of Gaussians and the optimizer that trains them.
    pub fn new(gaussians: &'a mut Gaussians, adam: &'a mut Adam) -> Self {
        Self { gaussians, adam }
    }

    /// The Gaussians as they are now.
    pub fn gaussians(&self) -> &Gaussians {
        self.gaussians
    }

    /// Their number `N`.
    pub fn len(&self) -> usize {
        self.gaussians.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Makes row `k` of the result a copy of row `rows[k]`. Moments are copied for the first `first_new` rows; the rows
    /// after them are new Gaussians, which begin without moments.
    ///
    /// # Panics
    /// If a row is not below [`len`](Self::len).
    pub fn select_rows(&mut self, rows: &[usize], first_new: usize) {
        let count = self.len();
        assert!(rows.iter().all(|row| *row < count), "a row beyond the {count} that there are");
        let device = self.gaussians.means.device().inner();
        let indices: Vec<i64> = rows.iter().map(|row| *row as i64).collect();
        let rows = Tensor::<1, Int>::from_data(TensorData::new(indices, [rows.len()]), &device);
        let fresh: Vec<f32> = (0..rows.dims()[0]).map(|k| if k < first_new { 0.0 } else { 1.0 }).collect();
        let fresh = Tensor::<1>::from_data(TensorData::new(fresh, rows.dims()), &device);
        for attribute in self.gaussians.attributes() {
            self.adam.select_rows(&attribute.path(), &rows, &fresh, count);
        }
        self.replace(|tensors| tensors.map(&mut SelectRows(rows)));
    }

    /// Keeps the Gaussians where `keep` is set. `[N]`
    pub fn keep(&mut self, keep: &[bool]) {
        let rows: Vec<usize> = keep.iter().enumerate().filter(|(_, keep)| **keep).map(|(i, _)| i).collect();
        self.select_rows(&rows, rows.len());
    }

    /// Changes values and keeps moments. `change` gets tensors without a tape and must return as many rows.
    ///
    /// # Panics
    /// If the number of rows changes.
    pub fn update(&mut self, change: impl FnOnce(GaussianTensors) -> GaussianTensors) {
        let count = self.len();
        self.replace(change);
        assert_eq!(self.len(), count, "`update` changes values; `select_rows` changes their number");
    }

    /// Zeroes the moments of one attribute for all Gaussians.
    pub fn reset_moments(&mut self, attribute: &Attribute) {
        self.adam.reset_moments(&attribute.path());
    }

    fn replace(&mut self, change: impl FnOnce(GaussianTensors) -> GaussianTensors) {
        let tensors = change(self.gaussians.tensors().inner());
        self.gaussians.set_tensors(tensors.map(&mut Trained));
    }
}

/// The rows of a list, for every attribute.
struct SelectRows(Tensor<1, Int>);

impl AttributeMapper for SelectRows {
    fn map<const D: usize>(&mut self, _: &Attribute, values: Tensor<D>) -> Tensor<D> {
        values.select(0, self.0.clone())
    }
}

/// Makes values parameters again.
struct Trained;

impl AttributeMapper for Trained {
    fn map<const D: usize>(&mut self, _: &Attribute, values: Tensor<D>) -> Tensor<D> {
        Tensor::from_inner(values).require_grad()
    }
}
