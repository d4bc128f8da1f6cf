//! The multiscale hexplane context model (paper III-C; DESIGN section 6): what every value of the hexplane costs in the file.
//!
//! [`ContextModel`] is a list of [`PriorPart`]s ([`Hyperprior`], [`InterPlane`], [`InterScale`]), a [`Checkerboard`] and the
//! network that turns what they know into a Gaussian for each value, [`EntropyParameters`].

mod arrays;
pub(crate) mod checkerboard;
pub(crate) mod entropy_parameters;
pub(crate) mod hyperprior;
pub(crate) mod inter_plane;
pub(crate) mod inter_scale;
pub(crate) mod model;
pub(crate) mod prior;

pub use checkerboard::{Checkerboard, CheckerboardConfig, anchor_mask, demultiplex, multiplex};
pub use entropy_parameters::{EntropyParameters, EntropyParametersConfig, Start};
pub use hyperprior::{Hyperprior, HyperpriorConfig};
pub use inter_plane::{InterPlane, InterPlaneConfig};
pub use inter_scale::{HighScaleHyperprior, InterScale, InterScaleConfig, upsample};
pub use model::{ContextModel, ContextModelConfig, ContextParts, KernelShape, PlaneRate, QuantizedPlane};
pub use prior::{CenteredPlanes, DescribedCondition, DescribedPrior, Passes, Prior, PriorPart};
