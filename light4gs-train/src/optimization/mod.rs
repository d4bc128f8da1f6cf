//! Parameters by name, their gradients, learning rates and optimizer.

pub mod adam;
pub mod gradients;
pub mod learning_rates;
pub mod parameters;
pub mod schedule;
