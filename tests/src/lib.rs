//! Code that the cross-crate tests share.

// Burn 0.22 deprecates its `ndarray` back end in favour of `flex`; we serve both.
#![allow(deprecated)]

pub mod golden;
// In a folder beside the hostile streams, which are a crate of their own because they need only the codec.
#[path = "../hostile/runs/mod.rs"]
pub mod hostile;
pub mod named;
pub mod odd_scenes;
pub mod planes;
pub mod program;
pub mod pytorch;
pub mod random;
pub mod raster;
pub mod splat_scene;
pub mod twin;

/// The program of the page on the library compiles and runs, and what the README has in Rust.
#[cfg(doctest)]
pub mod pages {
    #[doc = include_str!("../../docs/library.md")]
    pub struct Library;
    #[doc = include_str!("../../README.md")]
    pub struct Readme;
}
