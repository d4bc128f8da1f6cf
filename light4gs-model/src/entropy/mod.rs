//! Building blocks of entropy models: densities, bits of a symbol, quantization steps, convolutions over planes.
//!
//! [`FactorizedDensity`], [`LogisticMixture`] and [`EntropyBottleneck`] learn a density for each channel. [`gaussian_conditional`] gives the
//! bits of a value whose mean and scale are predicted. [`PlaneSteps`] and [`AdaptiveQuantization`] (paper III-D) say
//! how finely planes are rounded.

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
