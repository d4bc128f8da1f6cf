//! Parameters by path: their groups, gradients, learning rates and the optimizer.

pub mod adam;
pub mod gradients;
pub mod learning_rates;
pub mod parameters;
pub mod schedule;
