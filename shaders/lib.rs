//! The WGSL kernels of Light4GS's wgpu back end: each constant is a file of a folder here, named after it, with its
//! includes.
//!
//! `README.md` says what each kernel does. The host side is `light4gs_model::ops`, where every operation has a folder with the
//! name of its folder here; it assembles a kernel from constants (those of rendering come from `light4gs_codec::rendering`), then
//! includes, then the kernel itself.

#![no_std]

/// One kernel: a file of a folder here, with its includes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    /// The file's name without its ending.
    pub name: &'static str,
    /// The includes that come before it, in this order.
    pub includes: &'static [&'static str],
    /// The file.
    pub source: &'static str,
}

// The constants, made by `build.rs`.
include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
