//! Functions for C, and for languages that can call C: reads `.l4gs` files and draws them on the CPU.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | open a scene, and close it | [`l4gs_open_file`] or [`l4gs_open_bytes`], [`l4gs_close`] |
//! | know what it holds | [`l4gs_info`], then [`l4gs_name`], [`l4gs_extra`], [`l4gs_section`], [`l4gs_attribute`] |
//! | draw it | [`l4gs_render`] |
//! | have its Gaussians at a time | [`l4gs_gaussians_gsplat`] (activated), [`l4gs_gaussians_inria`] (as in PLY files) |
//! | open a take, and close it | [`l4gs_take_open_file`] or [`l4gs_take_open_bytes`], [`l4gs_take_close`] |
//! | know how long it is and when its segments are shown | [`l4gs_take_info`], then [`l4gs_take_segment`], [`l4gs_take_name`], [`l4gs_take_extra`] |
//! | draw it at a second | [`l4gs_take_render`]; [`l4gs_take_prepare`] on a thread that runs ahead |
//! | have its Gaussians at a second | [`l4gs_take_gaussians`], then [`l4gs_gaussians_counts`], [`l4gs_gaussians_copy_gsplat`], [`l4gs_gaussians_copy_inria`] |
//! | know why a call failed | its [`L4gsStatus`], then [`l4gs_last_error`], [`l4gs_last_error_kind`] |
//! | accept larger files than by default | [`l4gs_limits_large`], or [`l4gs_limits_default`] with other numbers |
//!
//! Programs in Rust do not need this crate: `light4gs-render` is the same without pointers.
//!
//! # Example
//!
//! `docs/bindings.md` has a program in C. The same calls from Rust:
//!
//! ```
//! use std::ptr::{null, null_mut};
//!
//! use light4gs_c::*;
//!
//! let bytes = light4gs_codec::encode(&light4gs_codec::SceneData::default())?;
//! let mut scene = null_mut();
//! // SAFETY: the bytes are there, and `scene` is a place for a pointer.
//! let status = unsafe { l4gs_open_bytes(bytes.as_ptr(), bytes.len(), null(), &mut scene) };
//! assert_eq!(status, L4gsStatus::Ok);
//!
//! let mut info = L4gsInfo::default();
//! // SAFETY: the scene is open, and `info` is a place for an `L4gsInfo`.
//! assert_eq!(unsafe { l4gs_info(scene, &mut info) }, L4gsStatus::Ok);
//! assert_eq!((info.bytes, info.gaussians), (bytes.len() as u64, 0));
//! // SAFETY: the scene is open, and not used any more.
//! unsafe { l4gs_close(scene) };
//! # Ok::<(), light4gs_codec::CodecError>(())
//! ```
//!
//! # Limits
//!
//! No function panics or unwinds into C: a panic becomes [`L4gsStatus::Internal`]. Errors belong to the thread that caused
//! them. An open scene or take does not change, and several threads may use it at once.
//!
//! # Map
//!
//! cbindgen makes `include/light4gs.h` from these sources, with `cbindgen.toml`.
//!
//! | file | what |
//! |---|---|
//! | `functions.rs` | the functions about this library, and about scenes |
//! | `take_functions.rs` | the functions about takes |
//! | `types.rs` | the structures that they take and fill |
//! | `scene.rs`, `take.rs` | the open scene, the open take |
//! | `caller.rs` | pointers from a caller, and what goes back through them |
//! | `failure.rs` | status, message and kind of an error; panics end here |
mod caller;
mod failure;
mod functions;
mod scene;
mod take;
mod take_functions;
mod types;

pub use failure::L4gsStatus;
pub use functions::*;
pub use scene::L4gsScene;
pub use take::{L4gsGaussians, L4gsTake};
pub use take_functions::*;
pub use types::*;
