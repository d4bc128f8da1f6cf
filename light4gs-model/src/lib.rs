//! Burn modules of a dynamic scene made of deformable 3D Gaussians.
//!
//! | room | what is in it | paper |
//! |---|---|---|
//! | [`scene`] | [`Gaussians`]; world coordinates to [-1, 1] ([`SceneCoordinates`]); what moves the Gaussians ([`DeformationField`], and the paper's, [`HexPlaneField`]); all of it together ([`DynamicScene`]) | III-A |
//! | [`planes`] | feature planes ([`FeaturePlanes`]) and their query; a plane over each pair of axes is a hexplane ([`HexPlaneConfig`]) | III-A |
//! | [`Splatter`] | differentiable rendering | 3DGS |
//! | [`Significance`] | what each Gaussian contributes over views and times | III-B |
//! | [`context`] | what every value of the planes costs in the file: the multiscale hexplane [`ContextModel`] | III-C |
//! | [`sh`] | what every spherical harmonic costs in the file: four models behind [`ShEntropy`] | III-D |
//! | [`entropy`] | what those are made of: densities, convolutions over planes, quantization steps ([`AdaptiveQuantization`]) | III-D |
//! | [`parameters`] | every float parameter of a module with its path | |
//! | [`ops`] | custom operations with hand-written derivatives | |
//!
//! Everything that learns is a Burn module of its own (`Config` and `init`) and works alone. The device that a tensor lies on
//! chooses the back end of the custom operations at run time.
//!
//! What can be exchanged without touching this crate: the field ([`DeformationField`]), parts of the context model
//! ([`PriorPart`]), the entropy model of the spherical harmonics ([`ShEntropy`]), and the loop around all of them. Each
//! describes its networks for the codec beside its own forward pass, so that both compute the same.

// Without a CPU back end nobody calls its kernels, which would take a condition at every item of `cpu/` to say.
#![cfg_attr(
    not(any(feature = "ndarray", feature = "flex")),
    allow(dead_code, unused_imports, unused_variables, unused_mut, unreachable_code)
)]

pub mod context;
mod cpu;
pub mod entropy;
#[cfg(feature = "wgpu")]
mod gpu;
mod gpu_error;
mod kernels;
pub mod ops;
pub mod parameters;
pub mod planes;
pub mod scene;
pub mod sh;
mod significance;
pub mod spherical_harmonics;
mod splatter;

pub use context::*;
pub use entropy::*;
pub use gpu_error::GpuError;
pub use planes::*;
pub use scene::*;
pub use sh::*;
pub use significance::{PixelContribution, Significance, VolumeWeight, least_significant};
pub use splatter::{Rendering, Splatter};
