//! Modules whose parameters come from a golden file, and whose gradients are compared with one, by name.

use burn::module::Param;
use burn::tensor::{Gradients, Tensor};
use light4gs_model::{NamedParameterVisitor, NamedParameters};

use crate::golden::{Golden, assert_close_relative, values_of};

struct Load<'a, N> {
    golden: &'a Golden,
    name_in_file: N,
}

impl<N: Fn(&str) -> Option<String>> NamedParameterVisitor for Load<'_, N> {
    fn visit<const D: usize>(&mut self, name: &str, parameter: &mut Param<Tensor<D>>) {
        let Some(name) = (self.name_in_file)(name) else { return };
        let value = self.golden.tensor::<D>(&name, &parameter.val().device());
        assert_eq!(value.dims(), parameter.dims(), "{name}");
        *parameter = Param::from_tensor(value);
    }
}

/// Replaces every parameter of which `name_in_file` knows the golden tensor.
pub fn load(module: &mut impl NamedParameters, golden: &Golden, name_in_file: impl Fn(&str) -> Option<String>) {
    module.visit_parameters(&mut Load { golden, name_in_file });
}

struct Compare<'a, F> {
    gradients: &'a Gradients,
    expected: F,
    what: String,
    share: f32,
    compared: usize,
}

impl<F: Fn(&str) -> Option<Vec<f32>>> NamedParameterVisitor for Compare<'_, F> {
    fn visit<const D: usize>(&mut self, name: &str, parameter: &mut Param<Tensor<D>>) {
        let Some(expected) = (self.expected)(name) else { return };
        let gradient = parameter.val().grad(self.gradients).unwrap_or_else(|| panic!("{name} has no gradient"));
        assert_close_relative(&format!("{} {name}", self.what), &values_of(&gradient), &expected, self.share);
        self.compared += 1;
    }
}

/// Compares the gradient of every parameter for which `expected` has one, and returns how many there were.
pub fn compare_gradients(
    what: &str,
    module: &mut impl NamedParameters,
    gradients: &Gradients,
    share: f32,
    expected: impl Fn(&str) -> Option<Vec<f32>>,
) -> usize {
    let mut compare = Compare { gradients, expected, what: what.to_owned(), share, compared: 0 };
    module.visit_parameters(&mut compare);
    compare.compared
}
