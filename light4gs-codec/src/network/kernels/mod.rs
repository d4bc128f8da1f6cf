//! The operations of a network, each in a fixed order of its sums (see [`crate::network`]).
//!
//! Loops run over several positions or outputs at once, which does not change the order of any sum.
//!
//! | file | what |
//! |---|---|
//! | `lanes.rs` | a linear layer at eight positions at a time |
//! | `padded_map.rs` | channels of a map with a border of zeros, and windows of it |
//! | `convolution.rs`, `transposed.rs`, `masked.rs` | the kinds of convolution |
//! | `upsampling.rs`, `reductions.rs` | resizing, means, transposition |
//! | `blend.rs` | weighted sums of numbers that are the same at all places |
//! | `elementary.rs` | exponential and logarithm |

mod blend;
mod convolution;
mod elementary;
mod lanes;
mod masked;
mod padded_map;
mod reductions;
mod transposed;
mod upsampling;

pub(crate) use blend::Blend;
pub(crate) use convolution::Convolution;
pub(crate) use elementary::{exponential, logarithm};
pub(crate) use lanes::{LANES, Lanes, kept};
pub(crate) use masked::{AnchorMap, MaskedConvolution, first_anchor, masked_taps};
pub(crate) use padded_map::{Columns, PaddedMap};
pub(crate) use reductions::{mean_over_height, mean_over_width, transposed};
pub(crate) use transposed::TransposedConvolution;
pub(crate) use upsampling::resized;

#[cfg(test)]
mod tests;
