//! Adam with a state for each parameter path, which follows when rows are added and removed.

use std::collections::{BTreeMap, HashMap};

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Int, Shape, Tensor};
use light4gs_model::ops::adam::{AdamStep, SteppedParameter, adam_steps};
use light4gs_model::parameters::{ParameterMapper, ParameterVisitor, update_parameters, visit_parameters};

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
    /// Steps every parameter of these modules that has a gradient and a learning rate, all at once: on a GPU that is one
    /// launch. `rate` gives the rate by group and path. The paths of a module follow the prefix beside it, which may be empty.
    pub fn step_modules(
        &mut self,
        modules: &mut [(&str, &mut dyn SteppedModule)],
        gradients: &mut GradientSums,
        rate: impl Fn(ParameterGroup, &str) -> Option<f64>,
    ) {
        let mut wanted = Wanted { prefix: "", rate: &rate, found: Vec::new() };
        for (prefix, module) in modules.iter() {
            wanted.prefix = prefix;
            module.look(&mut wanted);
        }
        let found = gradients.remove(&wanted.found.iter().map(|(id, _)| *id).collect::<Vec<_>>());
        let steps = wanted.found.into_iter().zip(found);
        let steps = steps.filter_map(|((id, rate), gradient)| Some((id, (rate, gradient?)))).collect();
        let mut take = Take { adam: self, prefix: "", steps, names: Vec::new(), begun: Vec::new() };
        for (prefix, module) in modules.iter_mut() {
            take.prefix = prefix;
            module.take(&mut take);
        }
        let Take { names, begun, .. } = take;
        let times: Vec<u32> = begun.iter().map(|parameter| parameter.step.time).collect();
        let stepped = names.into_iter().zip(times).zip(adam_steps(begun));
        let values = stepped.map(|(((name, shape), time), (value, moments))| {
            self.finish(name.clone(), time, moments);
            (name, (shape, value))
        });
        let mut give_back = GiveBack { prefix: "", values: values.collect() };
        for (prefix, module) in modules.iter_mut() {
            give_back.prefix = prefix;
            module.give_back(&mut give_back);
        }
    }

    /// Steps a parameter along its gradient, which has the parameter's shape and no tape.
    pub fn step<const D: usize>(
        &mut self,
        name: &str,
        parameter: &mut Param<Tensor<D>>,
        gradient: Tensor<D>,
        learning_rate: f64,
    ) {
        let (id, shape) = (parameter.id, parameter.dims());
        let value = std::mem::replace(parameter, without_a_value(id, &gradient.device())).into_value().inner();
        let begun = self.begin(name, value.flatten(0, D - 1), gradient.flatten(0, D - 1), learning_rate);
        let time = begun.step.time;
        let (value, moments) = adam_steps(vec![begun]).remove(0);
        self.finish(name.to_owned(), time, moments);
        *parameter = with_value(id, value.reshape(shape));
    }

    /// Takes the moments of a parameter for its next step.
    fn begin(&mut self, name: &str, value: Tensor<1>, gradient: Tensor<1>, learning_rate: f64) -> SteppedParameter {
        let (moments, time) = match self.states.remove(name) {
            Some(AdamState { first, second, time }) => ([first, second], time + 1),
            None => ([(); 2].map(|()| Tensor::zeros(value.dims(), &gradient.device())), 1),
        };
        let step = AdamStep { learning_rate: learning_rate as f32, beta_1: 0.9, beta_2: 0.999, epsilon: 1e-15, time };
        SteppedParameter { value, moments, gradient, step }
    }

    /// Keeps the moments after a step.
    fn finish(&mut self, name: String, time: u32, [first, second]: [Tensor<1>; 2]) {
        self.states.insert(name, AdamState { first, second, time });
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

/// A parameter whose tensor is elsewhere, so that it is not shared and a step can be made in place.
fn without_a_value<const D: usize>(id: ParamId, device: &Device) -> Param<Tensor<D>> {
    Param::initialized(id, Tensor::empty([0; D], device))
}

fn with_value<const D: usize>(id: ParamId, value: Tensor<D>) -> Param<Tensor<D>> {
    Param::initialized(id, Tensor::from_inner(value).require_grad())
}

/// A module of any type, for [`Adam::step_modules`].
pub trait SteppedModule {
    /// Lets the parameters be found that have a learning rate.
    fn look(&self, wanted: &mut Wanted<'_>);
    /// Lets the values of those with a gradient be taken.
    fn take(&mut self, take: &mut Take<'_>);
    /// Lets their new values be put back.
    fn give_back(&mut self, give_back: &mut GiveBack<'_>);
}

impl<M: Module> SteppedModule for M {
    fn look(&self, wanted: &mut Wanted<'_>) {
        visit_parameters(self, wanted);
    }

    fn take(&mut self, take: &mut Take<'_>) {
        update_parameters(self, take);
    }

    fn give_back(&mut self, give_back: &mut GiveBack<'_>) {
        update_parameters(self, give_back);
    }
}

fn joined(prefix: &str, path: &str) -> String {
    if prefix.is_empty() { path.to_owned() } else { format!("{prefix}.{path}") }
}

/// Finds the parameters that have a learning rate.
pub struct Wanted<'a> {
    prefix: &'a str,
    rate: &'a dyn Fn(ParameterGroup, &str) -> Option<f64>,
    found: Vec<(ParamId, f64)>,
}

impl ParameterVisitor for Wanted<'_> {
    fn visit<const D: usize>(&mut self, path: &str, parameter: &Param<Tensor<D>>) {
        let name = joined(self.prefix, path);
        // With spherical harmonics of degree 0 alone, `sh_rest` is empty: there is nothing to step, and kernels refuse empty
        // tensors.
        if let Some(rate) = ParameterGroup::of(&name).and_then(|group| (self.rate)(group, &name))
            && parameter.shape().num_elements() > 0
        {
            self.found.push((parameter.id, rate));
        }
    }
}

/// Takes the parameters that are stepped out of a module.
pub struct Take<'a> {
    adam: &'a mut Adam,
    prefix: &'a str,
    /// Learning rates and gradients.
    steps: HashMap<ParamId, (f64, Tensor<1>)>,
    /// With their shapes.
    names: Vec<(String, Vec<usize>)>,
    begun: Vec<SteppedParameter>,
}

impl ParameterMapper for Take<'_> {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some((rate, gradient)) = self.steps.remove(&parameter.id) else { return parameter };
        let name = joined(self.prefix, path);
        let (id, shape) = (parameter.id, parameter.dims());
        let empty = without_a_value(id, &gradient.device());
        let value = parameter.into_value().inner().flatten(0, D - 1);
        self.begun.push(self.adam.begin(&name, value, gradient, rate));
        self.names.push((name, shape.to_vec()));
        empty
    }
}

/// Puts them back.
pub struct GiveBack<'a> {
    prefix: &'a str,
    /// By name, with their shapes.
    values: HashMap<String, (Vec<usize>, Tensor<1>)>,
}

impl ParameterMapper for GiveBack<'_> {
    fn map<const D: usize>(&mut self, path: &str, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
        match self.values.remove(&joined(self.prefix, path)) {
            Some((shape, value)) => with_value(parameter.id, value.reshape::<D, _>(Shape::from(shape))),
            None => parameter,
        }
    }
}
