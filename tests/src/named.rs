//! Modules whose parameters come from a golden file and whose gradients are compared with those of a golden file, by
//! path.

use burn::module::{Module, Param};
use burn::tensor::{Gradients, Tensor};
use light4gs_model::FactorizedDensity;
use light4gs_model::parameters::{ParameterMapper, ParameterVisitor, update_parameters, visit_parameters};

use crate::golden::{Golden, assert_close_relative, values_of};

struct Load<'a, N> {
    golden: &'a Golden,
    name_in_file: N,
}

impl<N: Fn(&str) -> Option<String>> ParameterMapper for Load<'_, N> {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some(name) = (self.name_in_file)(path) else { return parameter };
        let value = self.golden.tensor::<D>(&name, &parameter.val().device());
        assert_eq!(value.dims(), parameter.dims(), "{name}");
        Param::from_tensor(value)
    }
}

/// Replaces every parameter for which `name_in_file` names a golden tensor.
pub fn load<M: Module>(module: &mut M, golden: &Golden, name_in_file: impl Fn(&str) -> Option<String>) {
    update_parameters(module, &mut Load { golden, name_in_file });
}

struct Compare<'a, F> {
    gradients: &'a Gradients,
    expected: F,
    what: String,
    share: f32,
    compared: usize,
}

impl<F: Fn(&str) -> Option<Vec<f32>>> ParameterVisitor for Compare<'_, F> {
    fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
        let Some(expected) = (self.expected)(path) else { return };
        let gradient = parameter.val().grad(self.gradients).unwrap_or_else(|| panic!("{path} has no gradient"));
        assert_close_relative(&format!("{} {path}", self.what), &values_of(&gradient), &expected, self.share);
        self.compared += 1;
    }
}

/// Compares the gradient of every parameter for which `expected` has one, and returns how many there were.
pub fn compare_gradients<M: Module>(
    what: &str,
    module: &M,
    gradients: &Gradients,
    share: f32,
    expected: impl Fn(&str) -> Option<Vec<f32>>,
) -> usize {
    let mut compare = Compare { gradients, expected, what: what.to_owned(), share, compared: 0 };
    visit_parameters(module, &mut compare);
    compare.compared
}

/// The arrays of a density in the order in which its parameters stand, by CompressAI's names: `matrices.0`, `biases.0`, `factors.0`,
/// and so on.
fn density_arrays(density: &FactorizedDensity) -> Vec<(String, Tensor<3>)> {
    let named = |kind: &'static str, arrays: Vec<Tensor<3>>| {
        arrays.into_iter().enumerate().map(move |(layer, array)| (layer, format!("{kind}.{layer}"), array))
    };
    let matrices = named("matrices", density.matrices()).chain(named("biases", density.biases()));
    let mut arrays: Vec<_> = matrices.chain(named("factors", density.factors())).collect();
    // The sort keeps the order within a layer.
    arrays.sort_by_key(|(layer, ..)| *layer);
    arrays.into_iter().map(|(_, name, array)| (name, array)).collect()
}

/// Replaces the parameters of a density by the golden arrays whose names begin with `prefix`.
pub fn load_density(density: &mut FactorizedDensity, golden: &Golden, prefix: &str) {
    let device = density.parameters.val().device();
    let values = density_arrays(density).into_iter().map(|(name, own)| {
        let value = golden.tensor::<3>(&format!("{prefix}{name}"), &device);
        assert_eq!(value.dims(), own.dims(), "{prefix}{name}");
        value.flatten::<2>(1, 2)
    });
    density.parameters = Param::from_tensor(Tensor::cat(values.collect(), 1));
}

/// Compares the gradients of a density with the golden arrays whose names begin with `prefix`, and returns how many there were.
pub fn compare_density(
    what: &str,
    density: &FactorizedDensity,
    gradients: &Gradients,
    share: f32,
    golden: &Golden,
    prefix: &str,
) -> usize {
    let mut of_density = density.clone();
    let gradient = density.parameters.val().grad(gradients);
    of_density.parameters = Param::from_tensor(gradient.unwrap_or_else(|| panic!("{what}: a density has no gradient")));
    let arrays = density_arrays(&of_density);
    for (name, found) in &arrays {
        let name = format!("{prefix}{name}");
        assert_close_relative(&format!("{what} {name}"), &values_of(found), &golden.values(&name), share);
    }
    arrays.len()
}
