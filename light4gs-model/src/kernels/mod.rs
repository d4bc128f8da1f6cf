//! What the kernels of every back end take and give: the seam between the operations of [`ops`](crate::ops) and `cpu/`, `gpu/`.

pub mod adam;
pub mod hexplane_query;
pub mod splat;
