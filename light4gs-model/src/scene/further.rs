//! Further attributes of Gaussians, as parameters and as tensors.

use std::sync::Arc;

use burn::module::{Content, Devices, Module, ModuleDisplay, ModuleDisplayDefault, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor};

use super::attributes::Attribute;

/// A further attribute of N Gaussians: canonical or at a time.
#[derive(Clone, Debug)]
pub struct FurtherTensor {
    /// The attribute.
    pub attribute: Arc<Attribute>,
    /// `[N, width]`, before the activation.
    pub values: Tensor<2>,
}

/// The further attributes of [`Gaussians`](crate::Gaussians), which are trained. The path of each one ends in its name,
/// as in `gaussians.further.lifetime`.
#[derive(Clone, Debug, Default)]
pub struct FurtherParameters {
    list: Vec<(Arc<Attribute>, Param<Tensor<2>>)>,
}

/// The name that visitors of a module get for it, as for Burn's own containers.
const CONTAINER: &str = "FurtherParameters";

impl FurtherParameters {
    pub(super) fn from_tensors(tensors: Vec<FurtherTensor>) -> Self {
        let parameter = |tensor: FurtherTensor| (tensor.attribute, Param::from_tensor(tensor.values));
        Self { list: tensors.into_iter().map(parameter).collect() }
    }

    pub(super) fn tensors(&self) -> Vec<FurtherTensor> {
        let tensor = |(attribute, values): &(Arc<Attribute>, Param<Tensor<2>>)| FurtherTensor {
            attribute: attribute.clone(),
            values: values.val(),
        };
        self.list.iter().map(tensor).collect()
    }

    /// The attributes.
    pub fn attributes(&self) -> impl Iterator<Item = &Attribute> + Clone {
        self.list.iter().map(|(attribute, _)| &**attribute)
    }

    fn change(self, change: impl Fn(Param<Tensor<2>>) -> Param<Tensor<2>>) -> Self {
        Self { list: self.list.into_iter().map(|(attribute, values)| (attribute, change(values))).collect() }
    }
}

impl Module for FurtherParameters {
    fn collect_devices(&self, devices: Devices) -> Devices {
        self.list.iter().fold(devices, |devices, (_, values)| values.collect_devices(devices))
    }

    fn fork(self, device: &Device) -> Self {
        self.change(|values| values.fork(device))
    }

    fn to_device(self, device: &Device) -> Self {
        self.change(|values| values.to_device(device))
    }

    fn train(self) -> Self {
        self.change(Module::train)
    }

    fn valid(&self) -> Self {
        Self { list: self.list.iter().map(|(attribute, values)| (attribute.clone(), values.valid())).collect() }
    }

    fn materialize(self) -> Self {
        self.change(Module::materialize)
    }

    fn visit<V: ModuleVisitor>(&self, visitor: &mut V) {
        for (attribute, values) in &self.list {
            visitor.enter_module(&attribute.name, CONTAINER);
            Module::visit(values, visitor);
            visitor.exit_module(&attribute.name, CONTAINER);
        }
    }

    fn map<M: ModuleMapper>(self, mapper: &mut M) -> Self {
        let map = |(attribute, values): (Arc<Attribute>, Param<Tensor<2>>)| {
            mapper.enter_module(&attribute.name, CONTAINER);
            let values = Module::map(values, mapper);
            mapper.exit_module(&attribute.name, CONTAINER);
            (attribute, values)
        };
        Self { list: self.list.into_iter().map(map).collect() }
    }
}

impl ModuleDisplayDefault for FurtherParameters {
    fn content(&self, content: Content) -> Option<Content> {
        let add = |content: Content, (attribute, values): &(Arc<Attribute>, _)| content.add(&attribute.name, values);
        self.list.iter().fold(content, add).optional()
    }
}

impl ModuleDisplay for FurtherParameters {}
