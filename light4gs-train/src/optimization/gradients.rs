//! Gradients by parameter name, added up over the parts of a loss that are differentiated apart from each other.

use std::collections::BTreeMap;

use burn::module::Param;
use burn::tensor::{Gradients, Tensor};
use light4gs_model::DynamicScene;

use crate::compression::Compression;
use crate::optimization::parameters::{ParameterGroup, ParameterVisitor, visit_compression, visit_parameters};

/// Sums of gradients. Equal parts, added in the same order, give equal sums to the last bit.
#[derive(Debug, Default)]
pub struct GradientSums {
    /// By parameter name, flattened, off the tape.
    sums: BTreeMap<String, Tensor<1>>,
}

impl GradientSums {
    /// Adds what a backward pass found out about a scene.
    pub fn add_scene(&mut self, scene: &mut DynamicScene, gradients: &mut Gradients) {
        visit_parameters(scene, &mut Collect { sums: self, gradients });
    }

    /// Adds what a backward pass found out about entropy models and quantisation steps.
    pub fn add_compression(&mut self, compression: &mut Compression, gradients: &mut Gradients) {
        visit_compression(compression, &mut Collect { sums: self, gradients });
    }

    /// Adds the sums of another part.
    pub fn add(&mut self, other: Self) {
        for (name, gradient) in other.sums {
            self.add_one(name, gradient);
        }
    }

    /// A parameter's gradient, flattened. None if no part depends on it.
    pub fn get(&self, name: &str) -> Option<Tensor<1>> {
        self.sums.get(name).cloned()
    }

    /// Takes a parameter's gradient out, flattened. None if no part depends on it.
    pub fn remove(&mut self, name: &str) -> Option<Tensor<1>> {
        self.sums.remove(name)
    }

    fn add_one(&mut self, name: String, gradient: Tensor<1>) {
        let sum = match self.sums.remove(&name) {
            Some(sum) => sum + gradient,
            None => gradient,
        };
        self.sums.insert(name, sum);
    }
}

struct Collect<'a> {
    sums: &'a mut GradientSums,
    gradients: &'a mut Gradients,
}

impl ParameterVisitor for Collect<'_> {
    fn visit<const D: usize>(&mut self, _: ParameterGroup, name: &str, parameter: &mut Param<Tensor<D>>) {
        if let Some(gradient) = parameter.val().grad_remove(self.gradients) {
            self.sums.add_one(name.to_owned(), gradient.flatten(0, D - 1));
        }
    }
}
