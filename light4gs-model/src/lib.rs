//! Burn modules of a dynamic scene made of deformable 3D Gaussians.
//!
//! | part | what it is | paper |
//! |---|---|---|
//! | [`Gaussians`] | a static set of Gaussians | III-A |
//! | [`SceneFrame`] | PCA and contraction of world coordinates to [-1, 1] | III-A |
//! | [`HexPlane`] | six feature planes over the pairs of x, y, z, t, at several scales | III-A |
//! | [`Deformation`] | from a feature to changes of position, scale, rotation | III-A |
//! | [`Splatter`] | differentiable rendering | 3DGS |
//! | [`DynamicScene`] | all of it together: Gaussians at a time, and the plain arrays of a `.l4gs` file | III |
//!
//! Every part is a Burn module of its own (`Config` and `init`) and works alone. Custom operations with hand-written
//! derivatives are in [`ops`]; the device that a tensor lies on chooses their back end at run time.

mod contraction;
mod cpu;
mod deformation;
mod dynamic_scene;
mod gaussians;
mod gpu;
mod hexplane;
pub mod ops;
mod plain_arrays;
pub mod regularizer;
mod scene_frame;
pub mod spherical_harmonics;
mod splatter;

pub use contraction::contract;
pub use deformation::{Deformation, DeformationConfig, DeformationHead, Deltas};
pub use dynamic_scene::{DynamicScene, DynamicSceneConfig};
pub use gaussians::{GaussianTensors, Gaussians, GaussiansConfig};
pub use gpu::GpuError;
pub use hexplane::{HexPlane, HexPlaneConfig, PLANE_NAMES, SPACE_ONLY_PLANES, SPACE_TIME_PLANES};
pub use plain_arrays::ModelError;
pub use scene_frame::{Pca, SceneFrame};
pub use splatter::{Rendering, Splatter};
