//! Inputs and outputs of the kernels of every back end: the seam between the operations of [`ops`](crate::ops) and
//! `cpu/`, `gpu/`.

pub(crate) mod activation;
pub(crate) mod adam;
pub(crate) mod image_difference;
pub(crate) mod mixture_bits;
pub(crate) mod neighborhoods;
pub(crate) mod node_poses;
pub(crate) mod node_regularizer;
pub(crate) mod plane_query;
pub(crate) mod skinning;
pub(crate) mod splat;
pub(crate) mod spline;
