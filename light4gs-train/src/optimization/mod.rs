//! Parameters by path: their groups, gradients, schedules and the optimizer.

pub mod adam;
pub mod gradients;
pub mod parameters;
pub mod schedule;
