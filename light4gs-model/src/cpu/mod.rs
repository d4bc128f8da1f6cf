//! Kernels of the CPU back ends, on plain slices, without Burn. Those of rendering are in `light4gs-render`.

pub(crate) mod adam;
pub(crate) mod image_difference;
pub(crate) mod mixture_bits;
pub(crate) mod neighborhoods;
pub(crate) mod node_motion;
pub(crate) mod node_poses;
pub(crate) mod node_regularizer;
pub(crate) mod planes;
pub(crate) mod skinning;
pub(crate) mod skinning_backward;
