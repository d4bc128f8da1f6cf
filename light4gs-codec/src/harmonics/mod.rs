//! Entropy coding of the spherical harmonics beyond degree 0 (paper III-D, DESIGN section 6).
//!
//! Channels are `coefficient · 3 + colour`. They fall into groups by degree, 9, 15 and 21 channels, and each group has
//! a sub-stream of its own. Within a group symbols run Gaussian by Gaussian, channel by channel.

mod conditional;
mod model;

pub(crate) use conditional::{Conditional, layer_shapes};
pub(crate) use model::{Conditions, HarmonicsModel, walk};

use crate::{FrequencyTable, LinearLayer};

/// How the spherical harmonics are coded.
#[derive(Clone, Debug, PartialEq)]
pub enum ShCoding {
    /// One distribution a channel: the factorised bottleneck, and the mixture of logistics.
    Tables {
        /// Quantisation step; a value is symbol times step.
        step: f32,
        /// `3 · ((degree + 1)² - 1)` tables.
        tables: Vec<FrequencyTable>,
    },
    /// Distributions that small networks give for each Gaussian.
    Conditional {
        /// Quantisation step; a value is symbol plus mean, times step.
        step: f32,
        /// What the networks see.
        kind: ShCondition,
        /// Two linear layers a network, with LeakyReLU (0.01) between. Outputs are scales, then means, in units of the
        /// step.
        layers: Vec<LinearLayer>,
    },
}

/// What the distribution of a spherical harmonic depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShCondition {
    /// The coefficients of lower degrees, degree 0 included: one network a degree, `sh_ar.{g}.0` and `sh_ar.{g}.2` for
    /// `g` = 0 (degree 1), 1, 2. Inputs: `sh_dc`, then the decoded values of lower groups.
    Autoregressive,
    /// The hexplane: one network, `sh_hex.0` and `sh_hex.2`. Inputs: the product of the three space-only planes at the
    /// decoded position, scale by scale.
    HexplaneCoupled,
}

/// Channels of the group of a degree, 1 to 3, and where they begin.
pub(crate) const fn group(degree: usize) -> (usize, usize) {
    (3 * (degree * degree - 1), 3 * (2 * degree + 1))
}
