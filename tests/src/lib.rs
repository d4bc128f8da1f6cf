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

/// The README's program compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;
