//! Adam with a state for each parameter path, which follows when rows are added and removed.

use std::collections::BTreeMap;

use burn::module::{Module, Param};
use burn::tensor::{Int, Tensor};
use light4gs_model::ops::adam::{AdamStep, adam_step};
use light4gs_model::parameters::{ParameterMapper, update_parameters};

use super::gradients::GradientSums;
use super::parameters::ParameterGroup;

/// Moments of one parameter.
#[derive(Clone, Debug)]
pub struct AdamState {
    /// First moment, flattened.
    pub first: Tensor<1>,
    /// Second moment, flattened.
    pub second: Tensor<1>,
    /// Steps taken.
    pub time: u32,
}

/// Adam with the usual betas (0.9, 0.999) and epsilon 1e-15; the learning rate is given with every step.
#[derive(Clone, Debug, Default)]
pub struct Adam {
    /// By parameter path.
    pub states: BTreeMap<String, AdamState>,
}

impl Adam {
    /// Steps every parameter of a module that has a gradient and a learning rate. `rate` gives the rate by group and
    /// path. `prefix` is put before the module's paths; it may be empty.
    pub fn step_module<M: Module>(
        &mut self,
        prefix: &str,
        module: &mut M,
        gradients: &mut GradientSums,
        rate: impl Fn(ParameterGroup, &str) -> Option<f64>,
    ) {
        update_parameters(module, &mut Step { adam: self, prefix, gradients, rate });
    }

    /// Steps a parameter along its gradient, which has the parameter's shape and no tape.
    pub fn step<const D: usize>(
        &mut self,
        name: &str,
        parameter: &mut Param<Tensor<D>>,
        gradient: Tensor<D>,
        learning_rate: f64,
    ) {
        let id = parameter.id;
        // Takes the tensor out, so that it is not shared and the step can be made in place.
        let empty = Param::initialized(id, Tensor::empty([0; D], &gradient.device()));
        let value = std::mem::replace(parameter, empty).into_value().inner();
        let shape = value.dims();
        let (first, second, time) = match self.states.remove(name) {
            Some(AdamState { first, second, time }) => (first, second, time + 1),
            None => {
                let zeros = || Tensor::zeros([shape.iter().product::<usize>()], &gradient.device());
                (zeros(), zeros(), 1)
            }
        };
        let step = AdamStep { learning_rate: learning_rate as f32, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time };
        let [value, first, second] =
            adam_step([value.flatten(0, D - 1), first, second], gradient.flatten(0, D - 1), step);
        self.states.insert(name.to_owned(), AdamState { first, second, time });
        *parameter = Param::initialized(id, Tensor::from_inner(value.reshape(shape)).require_grad());
    }

    /// Moves the moments with their rows: row k of the result is row `rows[k]`, or zeros where `fresh[k]`. `rows` and
    /// `fresh` are `[M]` tensors, `count` is the number of rows before.
    pub fn select_rows(&mut self, name: &str, rows: &Tensor<1, Int>, fresh: &Tensor<1>, count: usize) {
        let Some(state) = self.states.get_mut(name) else { return };
        let keep = fresh.clone().neg().add_scalar(1.0).unsqueeze_dim::<2>(1);
        for moment in [&mut state.first, &mut state.second] {
            let columns = moment.dims()[0] / count.max(1);
            let matrix = moment.clone().reshape([count, columns]).select(0, rows.clone());
            *moment = (matrix * keep.clone()).flatten(0, 1);
        }
    }

    /// Zeroes the moments of a parameter and keeps its step count.
    pub fn reset_moments(&mut self, name: &str) {
        if let Some(state) = self.states.get_mut(name) {
            state.first = state.first.zeros_like();
            state.second = state.second.zeros_like();
        }
    }
}

struct Step<'a, R> {
    adam: &'a mut Adam,
    prefix: &'a str,
    gradients: &'a mut GradientSums,
    rate: R,
}

impl<R: Fn(ParameterGroup, &str) -> Option<f64>> ParameterMapper for Step<'_, R> {
    fn map<const D: usize>(&mut self, path: &str, mut parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let joined = if self.prefix.is_empty() { path.to_owned() } else { format!("{}.{path}", self.prefix) };
        if let Some(rate) = ParameterGroup::of(&joined).and_then(|group| (self.rate)(group, &joined))
            && let Some(gradient) = self.gradients.remove(parameter.id)
            // With spherical harmonics of degree 0 alone, `sh_rest` is empty: there is nothing to step, and kernels
            // refuse empty tensors.
            && parameter.shape().num_elements() > 0
        {
            let gradient = gradient.reshape(parameter.dims());
            self.adam.step(&joined, &mut parameter, gradient, rate);
        }
        parameter
    }
}
