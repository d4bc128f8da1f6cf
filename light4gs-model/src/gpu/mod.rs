//! Kernels of the wgpu back end: the host side of the WGSL in `shaders/`.

mod adam;
mod context;
mod elementwise;
mod kernel;
mod planes;
mod significance;
mod skinning;
mod sort;
mod splat;
mod team;

pub(crate) use adam::adam_on_gpu;
pub(crate) use elementwise::{lower_bound_backward_on_gpu, normal_cdf_backward_on_gpu, normal_cdf_on_gpu};
pub(crate) use significance::significance_on_gpu;
