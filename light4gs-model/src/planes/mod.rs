//! Feature planes: what a field has learned about places and times, as maps over pairs of axes (K-Planes, HexPlane, 4DGS).
//!
//! [`FeaturePlanes`] is a list of planes at several scales. A [`PlaneLayout`](light4gs_codec::plane_layout::PlaneLayout) says
//! which there are: a plane over each pair of axes is a hexplane ([`HexPlaneConfig`], the paper's), the three over space are a
//! tri-plane, and any other set will do. [`PlaneTensors`] are the same planes as plain tensors, in which form noise, context
//! model and query see them.

mod feature_planes;
mod hexplane;
mod tensors;

pub use feature_planes::FeaturePlanes;
pub use hexplane::HexPlaneConfig;
pub use tensors::PlaneTensors;
