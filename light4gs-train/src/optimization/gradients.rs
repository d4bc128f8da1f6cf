//! Gradients by parameter, summed over the parts of a loss that are differentiated separately.

use std::collections::HashMap;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Gradients, Tensor};
use light4gs_model::parameters::{ParameterVisitor, visit_parameters};

/// Sums of gradients. Equal parts, added in the same order, give equal sums to the last bit.
///
/// Copies of a module share the identities of its parameters, so gradients of a copy with its own tape belong to the
/// original.
#[derive(Debug, Default)]
pub struct GradientSums {
    /// Flattened, without a tape.
    sums: HashMap<ParamId, Tensor<1>>,
}

impl GradientSums {
    /// Adds the gradients of a backward pass for the parameters of a module.
    pub fn add_module<M: Module>(&mut self, module: &M, gradients: &mut Gradients) {
        visit_parameters(module, &mut Collect { sums: self, gradients });
    }

    /// Adds the sums of another part.
    pub fn add(&mut self, other: Self) {
        for (parameter, gradient) in other.sums {
            self.add_one(parameter, gradient);
        }
    }

    /// A parameter's gradient, flattened. `None` if no part depends on it.
    pub fn get(&self, parameter: ParamId) -> Option<Tensor<1>> {
        self.sums.get(&parameter).cloned()
    }

    /// Removes and returns a parameter's gradient, flattened. `None` if no part depends on it.
    pub fn remove(&mut self, parameter: ParamId) -> Option<Tensor<1>> {
        self.sums.remove(&parameter)
    }

    /// Adds a parameter's gradient, flattened.
    pub fn add_one(&mut self, parameter: ParamId, gradient: Tensor<1>) {
        let sum = match self.sums.remove(&parameter) {
            Some(sum) => sum + gradient,
            None => gradient,
        };
        self.sums.insert(parameter, sum);
    }
}

struct Collect<'a> {
    sums: &'a mut GradientSums,
    gradients: &'a mut Gradients,
}

impl ParameterVisitor for Collect<'_> {
    fn visit<const D: usize>(&mut self, _: &str, parameter: &Param<Tensor<D>>) {
        if let Some(gradient) = parameter.val().grad_remove(self.gradients) {
            self.sums.add_one(parameter.id, gradient.flatten(0, D - 1));
        }
    }
}
