//! Kernels of the CPU back ends, on plain slices, without Burn.

pub(crate) mod adam;
pub(crate) mod blend;
pub(crate) mod lanes;
pub(crate) mod planes;
pub(crate) mod project;
pub(crate) mod rasterize;
pub(crate) mod rasterize_backward;
pub(crate) mod significance;
pub(crate) mod skinning;
pub(crate) mod skinning_backward;
pub(crate) mod tiles;
