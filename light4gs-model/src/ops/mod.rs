//! Custom operations as Burn backend extensions.
//!
//! Each has one trait with the operation (dispatched at run time to the device's back end and recorded by
//! autodiff) and, where it is differentiable, one with the forward and backward kernels that a back end implements.

// Burn 0.22 deprecates its `ndarray` back end in favour of `flex`; we serve both.
#![allow(deprecated)]

pub mod adam;
pub mod hexplane_query;
mod host;
pub mod lower_bound;
pub mod normal_cdf;
pub mod significance;
pub mod splat;
