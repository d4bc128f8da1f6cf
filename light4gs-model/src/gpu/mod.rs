//! Kernels of the wgpu back end: the host's side of the WGSL in `shaders/`.

mod adam;
mod context;
mod error;
mod hexplane;
mod kernel;
mod sort;
mod splat;
mod stages;
mod team;

pub(crate) use adam::adam_on_gpu;
pub use error::GpuError;
