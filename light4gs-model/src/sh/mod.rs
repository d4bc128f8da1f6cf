//! Entropy models of the higher spherical harmonics (paper III-D; DESIGN section 6): four of them, one interface.
//!
//! | model | a value's density comes from | travels as |
//! |---|---|---|
//! | [`ShBottleneck`] | its channel: a learned monotone network | integer tables |
//! | [`ShMixture`] | its channel: a few logistics | integer tables |
//! | [`ShAutoregressive`] | the colour and the lower degrees of the same Gaussian | layers |
//! | [`ShHexPlaneCoupled`] | the space-only planes at the Gaussian's position | layers |
//!
//! A channel is `coefficient * 3 + rgb` of `sh_rest [N, 15, 3]`; there are 45.

mod arrays;
pub(crate) mod autoregressive;
pub(crate) mod bottleneck;
pub(crate) mod entropy;
pub(crate) mod hexplane_coupled;
pub(crate) mod mixture;
pub(crate) mod model;
pub(crate) mod network;

pub use arrays::counted_sh_coding;
pub use autoregressive::{ShAutoregressive, ShAutoregressiveConfig};
pub use bottleneck::{ShBottleneck, ShBottleneckConfig};
pub use entropy::{SH_CHANNELS, ShEntropy, ShKnown, ShTables};
pub use hexplane_coupled::{ShHexPlaneCoupled, ShHexPlaneCoupledConfig, space_feature};
pub use mixture::{ShMixture, ShMixtureConfig};
pub use model::{ShEntropyConfig, ShEntropyModel};
pub use network::ShNetwork;
