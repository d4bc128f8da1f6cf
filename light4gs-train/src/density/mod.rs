//! How many Gaussians there are: cloning, splitting and pruning.

pub mod densification;
