//! Parameters by path: their groups, gradients, schedules and the optimizer.
//!
//! | task | use |
//! |---|---|
//! | step all parameters of some modules | [`Adam::step_modules`](adam::Adam::step_modules) |
//! | let the optimizer follow when Gaussians are added or removed | [`GaussianEditor`](crate::density::GaussianEditor) |
//! | sum gradients of losses that are differentiated separately | [`GradientSums`](gradients::GradientSums) |
//! | know which parameters share a learning rate | [`ParameterGroup`](parameters::ParameterGroup) |
//! | let a rate decay | [`schedule`] |

pub mod adam;
pub mod gradients;
pub mod parameters;
pub mod schedule;
