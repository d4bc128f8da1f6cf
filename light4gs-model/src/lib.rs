//! Burn modules of a dynamic scene made of deformable 3D Gaussians.
//!
//! | room | contents | paper |
//! |---|---|---|
//! | [`scene`] | [`Gaussians`]; from world coordinates to [-1, 1] ([`SceneCoordinates`]); what moves the Gaussians ([`DeformationField`], and the paper's, [`HexPlaneField`]); the whole model ([`DynamicScene`]) | III-A |
//! | [`planes`] | feature planes ([`FeaturePlanes`]) and their query; a plane over each pair of axes is a hexplane ([`HexPlaneConfig`]) | III-A |
//! | [`Splatter`] | differentiable rendering | 3DGS |
//! | [`Significance`] | how much each Gaussian contributes over views and times | III-B |
//! | [`context`] | the bits of every value of the planes: the multiscale hexplane [`ContextModel`] | III-C |
//! | [`sh`] | the bits of every spherical harmonic: four models behind [`ShEntropy`] | III-D |
//! | [`AttributeEntropy`] | the bits of the other attributes of Gaussians, and their learned steps | |
//! | [`entropy`] | the components of these models: densities, convolutions over planes, quantization steps ([`AdaptiveQuantization`]) | III-D |
//! | [`parameters`] | every float parameter of a module with its path | |
//! | [`ops`] | custom operations with hand-written derivatives | |
//! | `gpu` | with the feature `wgpu`: kernels as text and launches as data, to try them elsewhere | |
//!
//! Every part with parameters is a separate Burn module (`Config` and `init`), which can be used alone. The device of a
//! tensor chooses the back end of the custom operations at run time.
//!
//! These parts can be exchanged without changing this crate: the field ([`DeformationField`]), parts of the context
//! model ([`PriorPart`]), the entropy model of the spherical harmonics ([`ShEntropy`]), and the training loop around
//! them. Each part also describes its networks for the codec, so that both compute the same.

// Without a CPU back end the kernels for it are unused; otherwise each of them would need a condition of its own.
#![cfg_attr(
    not(any(feature = "ndarray", feature = "flex")),
    allow(dead_code, unused_imports, unused_variables, unused_mut, unreachable_code, unreachable_pub)
)]

mod attribute_entropy;
pub mod context;
pub mod entropy;
#[cfg(feature = "wgpu")]
pub mod gpu;
mod gpu_error;
pub mod ops;
pub mod parameters;
pub mod planes;
pub mod scene;
mod sensitivity;
pub mod sh;
mod significance;
mod splatter;

pub use attribute_entropy::{AttributeEntropy, ChannelPrediction, CodedAttribute, GaussianPlaces};
pub use context::*;
pub use entropy::*;
pub use gpu_error::GpuError;
pub use light4gs_render::spherical_harmonics;
pub use planes::*;
pub use scene::*;
pub use sensitivity::Sensitivity;
pub use sh::*;
pub use significance::{PixelContribution, Significance, VolumeWeight, least_significant};
pub use splatter::{Rendering, Splatter};
