//! The functions that attributes of Gaussians go through before they are drawn.

use light4gs_codec::rendering::MAX_LOGARITHM;

/// A function of one number.
#[derive(Clone, Copy, Debug)]
pub enum Curve {
    /// `1 / (1 + exp(-x))`.
    Sigmoid,
    /// `exp(min(x, MAX_LOGARITHM))`.
    BoundedExponential,
}

/// A bounded exponential from here on has reached its bound. A little below it, since no two compilers have the same last digit.
pub(crate) fn bound_reached() -> f32 {
    0.999 * MAX_LOGARITHM.exp()
}
