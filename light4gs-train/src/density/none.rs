//! No density control.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor};
use light4gs_keys::keys;

use super::{DensityConfig, DensityStrategy, GaussianEditor, TrainingPosition, ViewStatistics};
use crate::stage::Stage;

keys! {
    /// The Gaussians of the initial cloud are trained as they are: none is added, and only `train.prune` removes some.
    pub struct NoDensityControl {}
}

impl DensityConfig for NoDensityControl {
    fn strategy(&self) -> Box<dyn DensityStrategy> {
        Box::new(self.clone())
    }

    fn end(&self) -> usize {
        0
    }
}

impl DensityStrategy for NoDensityControl {
    fn begin_stage(&mut self, _: usize, _: &Device) {}

    fn after_backward(&mut self, _: &[ViewStatistics], _: &TrainingPosition) {}

    fn after_step(&mut self, _: &mut GaussianEditor, _: &TrainingPosition) {}

    fn rows_kept(&mut self, _: &[bool]) {}

    fn is_over(&self, _: Stage, _: usize) -> bool {
        true
    }

    fn state(&self) -> BTreeMap<String, Tensor<1>> {
        BTreeMap::new()
    }

    fn restore(&mut self, state: BTreeMap<String, Tensor<1>>, _: usize) -> Result<(), String> {
        match state.keys().next() {
            Some(name) => Err(format!("tensor `density.{name}` belongs to another density strategy than `none`")),
            None => Ok(()),
        }
    }
}
