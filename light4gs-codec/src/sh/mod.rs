//! The spherical harmonics beyond degree 0 in a stream: as float32, or entropy coded (paper III-D, docs/design.md).
//!
//! Channels are `coefficient · 3 + color`. They fall into groups by degree, 9, 15 and 21 channels, and each group has
//! a sub-stream of its own. Within a group symbols run Gaussian by Gaussian, channel by channel.

mod channels;
pub(crate) mod coding;
mod networks;
pub(crate) mod section;
mod walk;

pub use coding::{ShCoding, ShPrior, ShSource};
pub use section::ShBytes;

/// Channels of the group of a degree, 1 to 3, and where they begin.
pub(crate) const fn group(degree: usize) -> (usize, usize) {
    (3 * (degree * degree - 1), 3 * (2 * degree + 1))
}
