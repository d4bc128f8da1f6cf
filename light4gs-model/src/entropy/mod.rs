//! Building blocks of entropy models: densities, bits of a symbol, quantization steps, convolutions over planes.
//!
//! | values | use |
//! |---|---|
//! | whose mean and scale a network predicts | [`gaussian_conditional`] |
//! | of a channel with one density, in a loss that must be fast | [`LogisticMixture`] |
//! | of a channel with one density of any shape | [`FactorizedDensity`] |
//! | of a latent, which is also rounded around medians | [`EntropyBottleneck`] |
//! | of planes, which are rounded to multiples of a step | [`PlaneSteps`]; learned: [`AdaptiveQuantization`] (paper III-D) |
//!
//! [`PlaneConv`] and [`PlaneDeconv`] are the layers of the networks, which the codec can run too.

pub(crate) mod adaptive_quantization;
pub(crate) mod bottleneck;
pub(crate) mod convolution;
pub(crate) mod factorized_density;
pub mod gaussian_conditional;
pub(crate) mod logistic_mixture;
pub(crate) mod quantization_steps;

pub use adaptive_quantization::{AdaptiveQuantization, AdaptiveQuantizationConfig};
pub use bottleneck::{EntropyBottleneck, EntropyBottleneckConfig, Latent};
pub use convolution::{LEAKY_SLOPE, PlaneConv, PlaneConvConfig, PlaneDeconv, PlaneDeconvConfig, checkerboard_kernel};
pub use factorized_density::{FactorizedDensity, FactorizedDensityConfig, PlainDensity};
pub use logistic_mixture::{LogisticMixture, LogisticMixtureConfig, PlainMixture};
pub use quantization_steps::{PlaneSteps, QUANTIZATION_STEP};
