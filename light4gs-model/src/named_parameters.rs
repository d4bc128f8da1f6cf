//! Trained tensors with their names, for optimisers, checkpoints, the stream and tests.

use burn::module::Param;
use burn::tensor::Tensor;

use crate::entropy::convolution::{PlaneConv, PlaneDeconv};

/// Something to do with every parameter of a module, whatever its rank.
pub trait NamedParameterVisitor {
    /// Called once a parameter, in a fixed order. Names are those of the layers in the stream, with `.weight` or `.bias`
    /// behind them where there are both.
    fn visit<const D: usize>(&mut self, name: &str, parameter: &mut Param<Tensor<D>>);
}

/// A module that can show its parameters by name.
pub trait NamedParameters {
    /// Shows every parameter to the visitor.
    fn visit_parameters(&mut self, visitor: &mut impl NamedParameterVisitor);
}

/// A visitor that sees longer names: those of a part, with the part's own name in front.
pub(crate) struct Prefixed<'a, V> {
    pub(crate) prefix: &'static str,
    pub(crate) visitor: &'a mut V,
}

impl<V: NamedParameterVisitor> NamedParameterVisitor for Prefixed<'_, V> {
    fn visit<const D: usize>(&mut self, name: &str, parameter: &mut Param<Tensor<D>>) {
        self.visitor.visit(&format!("{}.{name}", self.prefix), parameter);
    }
}

/// A layer as the stream stores it, in PyTorch's layout.
#[derive(Clone, Copy, Debug)]
pub struct Layer<'a> {
    /// Its name in the stream.
    pub name: &'static str,
    /// `[O, I / groups, k, k]`, or `[I, O, k, k]` if transposed.
    pub weight: &'a Param<Tensor<4>>,
    /// `[O]`.
    pub bias: &'a Param<Tensor<1>>,
    /// Groups of channels.
    pub groups: usize,
    /// Whether only the encoder needs it, so that it never goes into a stream.
    pub encoder_only: bool,
}

impl<'a> Layer<'a> {
    pub(crate) fn conv(name: &'static str, layer: &'a PlaneConv) -> Self {
        Self { name, weight: &layer.weight, bias: &layer.bias, groups: layer.groups(), encoder_only: false }
    }

    pub(crate) fn deconv(name: &'static str, layer: &'a PlaneDeconv) -> Self {
        Self { name, weight: &layer.weight, bias: &layer.bias, groups: 1, encoder_only: false }
    }
}

pub(crate) fn visit_layer(
    name: &str,
    weight: &mut Param<Tensor<4>>,
    bias: &mut Param<Tensor<1>>,
    visitor: &mut impl NamedParameterVisitor,
) {
    visitor.visit(&format!("{name}.weight"), weight);
    visitor.visit(&format!("{name}.bias"), bias);
}
