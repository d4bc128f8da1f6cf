//! The vectors of `light4gs-render`, which contain all of its unsafe code, with their own tests.

#![allow(dead_code, reason = "the kernels that use them are not here")]

#[path = "../../../crates/light4gs-render/src/lanes.rs"]
mod lanes;
