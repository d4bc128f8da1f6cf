//! Gaussians to images on the CPU, forward and backward, on plain slices and without Burn.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | draw a `.l4gs` file at any time | [`PlayableScene`] |
//! | draw a take, a file of minutes | [`PlayableTake`] |
//! | pass its Gaussians to gsplat, or to readers of PLY files | [`conventions`] |
//! | draw Gaussians of your own | [`TileLists::build`], [`rasterize`], [`assemble`], in this order, on [`GaussianSlices`] and a [`View`] |
//! | differentiate these images | then [`splat_backward`] |
//! | score Gaussians by their contributions to an image | [`TileLists::build`], [`significance`] |
//! | evaluate colors or rotations alone | [`spherical_harmonics`], [`rotation`] |
//! | write another kernel with vectors | [`lanes`] |
//!
//! **In short:** programs that only draw need [`PlayableScene`]; the bindings for Python and C are such programs. The kernels
//! also serve the CPU back ends of `light4gs-model`, which adds differentiation by Burn.
//!
//! # Example
//!
//! ```
//! use light4gs_codec::{GaussianArrays, Limits, SceneData, encode};
//! use light4gs_data::Camera;
//! use light4gs_render::PlayableScene;
//!
//! // A file with one white ball at the origin.
//! let gaussians = GaussianArrays {
//!     means: vec![[0.0; 3]],
//!     log_scales: vec![[-1.0; 3]],
//!     quats: vec![[1.0, 0.0, 0.0, 0.0]],
//!     opacity_logits: vec![4.0],
//!     sh_dc: vec![[1.77; 3]],
//!     ..Default::default()
//! };
//! let bytes = encode(&SceneData { gaussians, ..Default::default() })?;
//!
//! let scene = PlayableScene::decode(&bytes, &Limits::default())?;
//! let (eye, target, up) = ([0.0, -4.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]);
//! let camera = Camera::look_at(eye.into(), target.into(), up.into(), 0.7, 33, 33);
//! let image = scene.render(&camera, 0.5, [0.0; 3])?; // [33, 33, 3] over black
//! let red = |x: usize, y: usize| image[3 * (33 * y + x)];
//! assert!(red(16, 16) > 0.9 && red(0, 0) < 0.1);
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! # Reasons
//!
//! Images are divided into tiles, each with the list of its Gaussians from front to back, as in the original 3DGS. A tile is
//! blended eight pixels at a time, in the vectors of the processor at hand. Every sum has a fixed order: the result does
//! not depend on the number of threads.
//!
//! # Limits
//!
//! Between processors with and without AVX2 images differ in the last bits; the Gaussians of [`PlayableScene`] do not. The
//! kernels take slices of fitting lengths and panic otherwise; [`PlayableScene`] bounds memory and refuses with an error.
pub mod conventions;
mod drawing;
pub mod lanes;
mod playable;
mod playable_take;
pub mod rotation;
pub mod spherical_harmonics;
mod splatting;
mod view;

pub use playable::PlayableScene;
pub use playable_take::PlayableTake;
pub use splatting::{
    CHANNELS, GaussianGradients, GaussianSlices, INVALID_RADIUS, SCORES, TileLists, TilePixels, assemble, rasterize,
    significance, splat_backward,
};
pub use view::View;
