//! Gradients by parameter, summed over the parts of a loss that are differentiated separately.

use std::collections::HashMap;

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Gradients, Tensor};
use light4gs_model::ops::sums::sums;
use light4gs_model::parameters::{ParameterVisitor, visit_parameters};

/// Sums of gradients. Equal parts, added in the same order, give equal sums to the last bit.
///
/// Copies of a module share the identities of its parameters, so gradients of a copy with its own tape belong to the
/// original.
#[derive(Debug, Default)]
pub struct GradientSums {
    /// The parts of each, flattened, without a tape. They are added up when a sum is needed, those of all parameters at once:
    /// on a GPU each addition would be a launch.
    parts: HashMap<ParamId, Vec<Tensor<1>>>,
}

impl GradientSums {
    /// Adds the gradients of a backward pass for the parameters of a module.
    pub fn add_module<M: Module>(&mut self, module: &M, gradients: &mut Gradients) {
        visit_parameters(module, &mut Collect { sums: self, gradients });
    }

    /// Adds the parts of other sums.
    pub fn add(&mut self, other: Self) {
        for (parameter, parts) in other.parts {
            self.parts.entry(parameter).or_default().extend(parts);
        }
    }

    /// The gradients of these parameters, flattened, in their order. `None` for one that no part depends on.
    pub fn get(&mut self, parameters: &[ParamId]) -> Vec<Option<Tensor<1>>> {
        self.add_up(parameters);
        parameters.iter().map(|parameter| self.parts.get(parameter).map(|parts| parts[0].clone())).collect()
    }

    /// Removes and returns the gradients of these parameters, flattened, in their order. `None` for one that no part depends on.
    pub fn remove(&mut self, parameters: &[ParamId]) -> Vec<Option<Tensor<1>>> {
        self.add_up(parameters);
        parameters.iter().map(|parameter| self.parts.remove(parameter).map(|mut parts| parts.remove(0))).collect()
    }

    /// Adds a parameter's gradient, flattened.
    pub fn add_one(&mut self, parameter: ParamId, gradient: Tensor<1>) {
        self.parts.entry(parameter).or_default().push(gradient);
    }

    /// Leaves one part of each of these parameters. If any has more, the sums of all lie side by side on a GPU, as operations on
    /// many tensors want them.
    fn add_up(&mut self, parameters: &[ParamId]) {
        let parts = |parameter: &ParamId| self.parts.get(parameter).map_or(0, Vec::len);
        if parameters.iter().any(|parameter| parts(parameter) > 1) {
            let there: Vec<ParamId> = parameters.iter().filter(|parameter| parts(parameter) > 0).copied().collect();
            let lists = there.iter().filter_map(|parameter| self.parts.remove(parameter)).collect();
            for (parameter, sum) in there.into_iter().zip(sums(lists)) {
                self.parts.insert(parameter, vec![sum]);
            }
        }
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
