//! The exact executor: the small networks that choose coding intervals, evaluated to the same bits on every machine.
//!
//! An encoder and a decoder that disagree about one bit of a parameter read two different streams, so nothing here
//! is left to a library: every output is its bias, plus the products of weight and input in a fixed order, each
//! product and each sum rounded to float32. There are no fused multiply-adds (Rust does not contract) and no functions
//! but comparison, division and square root, which IEEE 754 defines to the bit. Loops run over several positions or
//! outputs at once, which changes no output's order.
//!
//! | file | what |
//! |---|---|
//! | `lanes.rs` | a linear layer on eight positions at a time, LeakyReLU |
//! | `padded_map.rs` | channels of a map with a border of zeros, and windows of it |
//! | `convolution.rs`, `transposed.rs`, `masked.rs` | the three kinds of convolution of the context model |
//! | `upsampling.rs`, `time_mean.rs` | from a lower scale, and from the planes over time |
//! | `hyper_synthesis.rs`, `entropy_parameters.rs` | the networks that are made of these |
//! | `multilayer.rs` | the two-layer networks of the conditional spherical harmonics |

mod convolution;
mod entropy_parameters;
mod hyper_synthesis;
mod lanes;
mod masked;
mod multilayer;
mod padded_map;
mod time_mean;
mod transposed;
mod upsampling;

pub(crate) use convolution::Convolution;
pub(crate) use entropy_parameters::EntropyParameters;
pub(crate) use hyper_synthesis::HyperSynthesis;
pub(crate) use lanes::{LANES, Lanes};
pub(crate) use masked::{AnchorMap, MaskedConvolution, first_anchor};
pub(crate) use multilayer::TwoLayers;
pub(crate) use padded_map::{Columns, PaddedMap};
pub(crate) use time_mean::{spread_time_means, time_means};
pub(crate) use upsampling::upsample;

#[cfg(test)]
mod tests;
