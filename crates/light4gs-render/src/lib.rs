//! Gaussians to images on the CPU, forward and backward, on plain slices and without Burn.
//!
//! The kernels serve the CPU back ends of `light4gs-model` and the programs that only draw: the bindings for Python and C.
//!
//! | room | contents |
//! |---|---|
//! | [`PlayableScene`] | a decoded file: its Gaussians at a time, images of them |
//! | [`conventions`] | the Gaussians as other programs take them |
//! | [`GaussianSlices`], [`View`], [`TileLists`], [`rasterize`], [`assemble`], [`splat_backward`], [`significance`] | the kernels |
//! | [`rotation`] | rotations of quaternions, and their gradients |
//! | [`spherical_harmonics`] | the basis functions of colors |
//! | [`lanes`] | eight float32 numbers at once, as the processor has them |

pub mod conventions;
pub mod lanes;
mod playable;
pub mod rotation;
pub mod spherical_harmonics;
mod splatting;
mod view;

pub use playable::PlayableScene;
pub use splatting::{
    CHANNELS, GaussianGradients, GaussianSlices, INVALID_RADIUS, SCORES, TileLists, TilePixels, assemble, rasterize,
    significance, splat_backward,
};
pub use view::View;
