//! Tests of several crates together in one process: back ends against each other, modules against the codec,
//! derivatives, imports, all legal configurations.

mod attribute_entropy;
mod back_ends_agree;
mod backdrop;
mod compression;
mod context_model;
mod control_nodes;
mod corrections;
mod every_legal_value;
mod exact_networks;
mod finite_differences;
mod gpu_kernels;
mod import;
mod operations;
mod paper;
mod plane_convolutions;
mod poisoned_scenes;
mod principal_point;
mod rooms;
mod sensitivity;
mod sh_entropy;
mod skinning;
