//! Modules whose parameters come from a golden file and whose gradients are compared with those of a golden file, by
//! path.

use burn::module::{Module, Param};
use burn::tensor::{Gradients, Tensor};
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
