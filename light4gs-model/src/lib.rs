//! Burn modules of a dynamic scene made of deformable 3D Gaussians.
//!
//! | part | what it is | paper |
//! |---|---|---|
//! | [`Gaussians`] | a static set of Gaussians | III-A |
//! | [`SceneCoordinates`] | PCA and contraction of world coordinates to [-1, 1] | III-A |
//! | [`HexPlane`] | six feature planes over the pairs of x, y, z, t, at several scales | III-A |
//! | [`Deformation`] | from a feature to changes of position, scale, rotation | III-A |
//! | [`Splatter`] | differentiable rendering | 3DGS |
//! | [`Significance`] | what each Gaussian contributes over views and times | III-B |
//! | [`ContextModel`] | what every value of the hexplane costs in the file: the multiscale hexplane context model | III-C |
//! | [`AdaptiveQuantization`] | learned quantisation steps | III-D |
//! | [`ShEntropyModel`] | what every spherical harmonic costs in the file: four models | III-D |
//! | [`DynamicScene`] | all of it together: Gaussians at a time, and the plain arrays of a `.l4gs` file | III |
//!
//! Every part is a Burn module of its own (`Config` and `init`) and works alone. Custom operations with hand-written
//! derivatives are in [`ops`]; the device that a tensor lies on chooses their back end at run time.

pub mod context;
mod cpu;
pub mod entropy;
#[cfg(feature = "wgpu")]
mod gpu;
mod gpu_error;
pub mod ops;
pub mod parameters;
pub mod scene;
pub mod sh;
mod significance;
mod splatter;

pub use context::*;
pub use entropy::*;
pub use gpu_error::GpuError;
pub use scene::*;
pub use sh::*;
pub use significance::{Significance, SignificanceScore, VolumeWeight, least_significant};
pub use splatter::{Rendering, Splatter};
