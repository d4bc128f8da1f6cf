//! Burn modules of a dynamic scene made of deformable 3D Gaussians.
//!
//! | part | what it is | paper |
//! |---|---|---|
//! | [`Gaussians`] | a static set of Gaussians | III-A |
//! | [`SceneFrame`] | PCA and contraction of world coordinates to [-1, 1] | III-A |
//! | [`HexPlane`] | six feature planes over the pairs of x, y, z, t, at several scales | III-A |
//! | [`Deformation`] | from a feature to changes of position, scale, rotation | III-A |
//! | [`Splatter`] | differentiable rendering | 3DGS |
//! | [`Significance`] | what each Gaussian contributes over views and times | III-B |
//! | [`ContextModel`] | what every value of the hexplane costs in the file: the multiscale hexplane context model | III-C |
//! | [`AdaptiveQuantization`] | learned quantisation steps | III-D |
//! | [`ShEntropyModel`] | what every spherical harmonic costs in the file: four models | III-D |
//! | [`DynamicScene`] | all of it together: Gaussians at a time, and the plain arrays of a `.l4gs` file | III |
//!
//! Every part is a Burn module of its own (`Config` and `init`) and works alone. Custom operations with hand-written
//! derivatives are in [`ops`]; the device that a tensor lies on chooses their back end at run time.

mod adaptive_quantization;
mod checkerboard;
pub mod context_model;
mod contraction;
mod cpu;
mod deformation;
mod dynamic_scene;
mod entropy_arrays;
mod entropy_bottleneck;
mod entropy_parameters;
mod factorized_density;
pub mod gaussian_conditional;
mod gaussians;
#[cfg(feature = "wgpu")]
mod gpu;
mod gpu_error;
mod hexplane;
mod hyperprior;
mod inter_plane;
mod inter_scale;
mod named_parameters;
pub mod ops;
mod plain_arrays;
mod plane_conv;
mod prior;
mod quantization_steps;
pub mod regularizer;
mod scene_frame;
mod sh_autoregressive;
mod sh_bottleneck;
mod sh_entropy;
mod sh_hexplane_coupled;
mod sh_mixture;
mod sh_network;
mod significance;
pub mod spherical_harmonics;
mod splatter;

pub use adaptive_quantization::{AdaptiveQuantization, AdaptiveQuantizationConfig};
pub use checkerboard::{Checkerboard, CheckerboardConfig, anchor_mask, demultiplex, multiplex};
pub use context_model::{ContextModel, ContextModelConfig, ContextParts, KernelShape, PlaneRate, QuantizedPlane};
pub use contraction::contract;
pub use deformation::{Deformation, DeformationConfig, DeformationHead, Deltas};
pub use dynamic_scene::{DynamicScene, DynamicSceneConfig};
pub use entropy_arrays::counted_sh_coding;
pub use entropy_bottleneck::{EntropyBottleneck, EntropyBottleneckConfig, Latent};
pub use entropy_parameters::{EntropyParameters, EntropyParametersConfig, PlaneGaussians, Start};
pub use factorized_density::{FactorizedDensity, FactorizedDensityConfig, PlainDensity};
pub use gaussians::{GaussianTensors, Gaussians, GaussiansConfig};
pub use gpu_error::GpuError;
pub use hexplane::{HexPlane, HexPlaneConfig, PLANE_NAMES, SPACE_ONLY_PLANES, SPACE_TIME_PLANES};
pub use hyperprior::{Hyperprior, HyperpriorConfig};
pub use inter_plane::{InterPlane, InterPlaneConfig};
pub use inter_scale::{HighScaleHyperprior, InterScale, InterScaleConfig, upsample};
pub use named_parameters::{Layer, NamedParameterVisitor, NamedParameters};
pub use plain_arrays::ModelError;
pub use plane_conv::{PlaneConv, PlaneConvConfig, PlaneDeconv, PlaneDeconvConfig, checkerboard_kernel};
pub use prior::{CenteredPlanes, Passes, Prior, PriorPart, coding_order};
pub use quantization_steps::PlaneSteps;
pub use scene_frame::{Pca, SceneFrame};
pub use sh_autoregressive::{ShAutoregressive, ShAutoregressiveConfig};
pub use sh_bottleneck::{ShBottleneck, ShBottleneckConfig};
pub use sh_entropy::{SH_CHANNELS, ShEntropy, ShEntropyConfig, ShEntropyModel, ShKnown, ShTables};
pub use sh_hexplane_coupled::{ShHexPlaneCoupled, ShHexPlaneCoupledConfig, space_feature};
pub use sh_mixture::{ShMixture, ShMixtureConfig};
pub use sh_network::ShNetwork;
pub use significance::{Significance, SignificanceScore, VolumeWeight, least_significant};
pub use splatter::{Rendering, Splatter};
