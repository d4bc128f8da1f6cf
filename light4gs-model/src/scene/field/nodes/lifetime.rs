//! Lifetimes: a Gaussian's opacity times a bell curve over time, for motion that no rigid body can follow.

use burn::tensor::{Tensor, s};
use light4gs_codec::network::{Network, Operation, Value};

use super::stream::affine;
use crate::scene::Attribute;
use crate::scene::field::Moment;

/// The attribute with the lifetime of a Gaussian, `[N, 2]`: the middle, and the logarithm of the standard deviation, in the
/// scene's time.
pub const LIFETIME: &str = "lifetime";

/// The middle of the scene's time, and a deviation at which nothing fades yet: 98 % of the opacity is left at both ends of
/// time.
const START: [f32; 2] = [0.5, 1.0];
/// Learning rate of lifetimes, and their step in a file.
const RATE: f64 = 0.005;
const STEP: f64 = 0.03;

pub(super) fn attribute() -> Attribute {
    Attribute::new(LIFETIME, 2).with_start(START.to_vec()).constant().with_learning_rate(RATE).with_step(STEP)
}

/// The lifetime around a moment.
pub(super) fn of(moment: &Moment) -> Vec<f32> {
    vec![moment.time, moment.deviation.ln()]
}

/// Opacity logits `[N, 1]` at a time: with the opacity `1 / (1 + e)`, where `e = exp(-logit)`, and the bell curve `b`, the new
/// logit is `log b - log(1 - b + e)`.
pub(super) fn faded(logits: &Tensor<2>, lifetime: Tensor<2>, time: f32) -> Tensor<2> {
    let middle = lifetime.clone().slice(s![.., 0..1]);
    let deviation = lifetime.slice(s![.., 1..2]).exp();
    let log_bell = ((middle.neg() + time) / deviation).powi_scalar(2) * -0.5;
    let e = logits.clone().neg().exp();
    log_bell.clone() - (log_bell.exp().neg() + 1.0 + e).log()
}

/// The same as operations of the codec.
pub(super) fn describe(network: &mut Network, logit: Value, lifetime: Value, time: Value) -> Value {
    let middle = network.node(Operation::Select(vec![0]), &[lifetime]);
    let deviation = network.node(Operation::Select(vec![1]), &[lifetime]);
    let deviation = network.node(Operation::Exponential, &[deviation]);
    let distance = network.node(Operation::Subtract, &[middle, time]);
    let distance = network.node(Operation::Divide, &[distance, deviation]);
    let square = network.node(Operation::Multiply, &[distance, distance]);
    let log_bell = network.node(affine(-0.5, 0.0), &[square]);
    let bell = network.node(Operation::Exponential, &[log_bell]);
    let e = network.node(affine(-1.0, 0.0), &[logit]);
    let e = network.node(Operation::Exponential, &[e]);
    let rest = network.node(affine(-1.0, 1.0), &[bell]);
    let rest = network.node(Operation::Add, &[rest, e]);
    let rest = network.node(Operation::Logarithm, &[rest]);
    network.node(Operation::Subtract, &[log_bell, rest])
}
