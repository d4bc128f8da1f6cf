//! Feature planes: learned features of points in space and time, as maps over pairs of axes (K-Planes, HexPlane, 4DGS).
//!
//! [`FeaturePlanes`] is a list of planes at several scales. A
//! [`PlaneLayout`](light4gs_codec::plane_layout::PlaneLayout) says which planes there are: a plane over each pair of
//! axes is a hexplane ([`HexPlaneConfig`], the paper's), the three over space are a tri-plane, and any other set is
//! possible. [`PlaneTensors`] are the same planes as plain tensors, for noise, context model and query.

mod feature_planes;
mod hexplane;
mod tensors;

pub use feature_planes::FeaturePlanes;
pub use hexplane::{HexPlaneConfig, MOST_PLANE_RESOLUTION};
pub use tensors::PlaneTensors;
