//! Burn modules of a dynamic scene made of deformable 3D Gaussians: motion, differentiable rendering, entropy models.
//!
//! # Which of these do I need?
//!
//! | task | start with |
//! |---|---|
//! | make Gaussians from a point cloud | [`GaussiansConfig`] |
//! | render them, with gradients | [`Splatter`] |
//! | let them move | [`DynamicSceneConfig`] with a field: [`HexPlaneField`] is the paper's, [`NodesField`] moves nearly rigid objects in few bytes |
//! | use a motion of your own | [`DeformationField`] |
//! | give Gaussians one more attribute | [`Attribute`] |
//! | store the scene, or read it from a file | [`DynamicScene::to_arrays`], [`DynamicScene::from_arrays`], with `light4gs-codec` |
//! | estimate the bits of planes, of harmonics, of other attributes | [`ContextModel`], [`ShEntropyModel`], [`AttributeEntropy`] |
//! | prune Gaussians that contribute little | [`Significance`], [`Sensitivity`], [`least_significant`] |
//! | step parameters by a rule of your own, or store them | [`parameters`] |
//! | compose a model of other shape from the same operations | [`FeaturePlanes`], [`entropy`], [`ops`] |
//! | check kernels on another GPU or compiler | `gpu`, with the feature `wgpu` |
//!
//! **In short:** [`DynamicScene`] and [`Splatter`] suffice for a training loop of your own. `light4gs-train` has one ready.
//!
//! # Example
//!
//! ```
//! use burn::tensor::{Device, Tensor};
//! use light4gs_data::{Camera, PointCloud};
//! use light4gs_model::{DynamicSceneConfig, GaussiansConfig, NodesField, NodesFieldConfig, Splatter};
//!
//! // Two gray Gaussians, and control nodes that will move them.
//! let device = Device::flex().autodiff();
//! let cloud = PointCloud { positions: vec![[0.0; 3], [0.3, 0.0, 0.0]], colors: vec![[0.5; 3]; 2] };
//! let gaussians = GaussiansConfig::new().with_sh_degree(0);
//! let scene = DynamicSceneConfig::<NodesField>::new(gaussians, NodesFieldConfig::default()).init(&cloud, &device);
//!
//! // Their image in the middle of the time, over white. It should be white everywhere.
//! let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 40, 30);
//! let image = Splatter::new([1.0; 3], 0).render(scene.at(0.5), &camera, None).image;
//! let loss = (image - Tensor::ones([30, 40, 3], &device)).abs().mean();
//!
//! // Descent lowers the opacities.
//! let gradients = loss.backward();
//! let of_opacities = scene.gaussians.opacity_logits.val().grad(&gradients).unwrap();
//! assert_eq!(of_opacities.dims(), [2, 1]);
//! assert!(of_opacities.into_data().iter::<f32>().all(|slope| slope > 0.0));
//! ```
//!
//! # Rooms
//!
//! | room | contents | paper |
//! |---|---|---|
//! | [`scene`] | [`Gaussians`]; from world coordinates to [-1, 1] ([`SceneCoordinates`]); what moves the Gaussians ([`DeformationField`], and the paper's, [`HexPlaneField`]); the whole model ([`DynamicScene`]) | III-A |
//! | [`planes`] | feature planes ([`FeaturePlanes`]) and their query; a plane over each pair of axes is a hexplane ([`HexPlaneConfig`]) | III-A |
//! | [`Splatter`] | differentiable rendering | 3DGS |
//! | [`Backdrop`] | Gaussians that are drawn with others and not trained | |
//! | [`Significance`] | the contribution of each Gaussian over views and times | III-B |
//! | [`context`] | the bits of every value of the planes: the multiscale hexplane [`ContextModel`] | III-C |
//! | [`sh`] | the bits of every spherical harmonic: models behind [`ShEntropy`] | III-D |
//! | [`AttributeEntropy`] | the bits of the other attributes of Gaussians, and their learned steps | |
//! | [`entropy`] | the components of these models: densities, convolutions over planes, quantization steps ([`AdaptiveQuantization`]) | III-D |
//! | [`parameters`] | every float parameter of a module with its path | |
//! | [`ops`] | custom operations with hand-written derivatives | |
//! | `gpu` | with the feature `wgpu`: kernels as text and launches as data, to try them elsewhere | |
//!
//! Every part with parameters is a separate Burn module (`Config` and `init`), which can be used alone. The device of a
//! tensor chooses the back end of the custom operations at run time.
//!
//! These parts can be exchanged without changing this crate: the field ([`DeformationField`]), parts of the context
//! model ([`PriorPart`]), the entropy model of the spherical harmonics ([`ShEntropy`]), and the training loop around
//! them. Each part also describes its networks for the codec, so that both compute the same.

// Without a CPU back end the kernels for it are unused; otherwise each of them would need a condition of its own.
#![cfg_attr(
    not(any(feature = "ndarray", feature = "flex")),
    allow(dead_code, unused_imports, unused_variables, unused_mut, unreachable_code, unreachable_pub)
)]

mod attribute_entropy;
mod backdrop;
pub mod context;
pub mod entropy;
#[cfg(feature = "wgpu")]
pub mod gpu;
mod gpu_error;
pub mod ops;
pub mod parameters;
pub mod planes;
mod read_backs;
pub mod scene;
mod sensitivity;
pub mod sh;
mod significance;
mod splatter;
mod tape;

pub use attribute_entropy::{AttributeEntropy, ChannelPrediction, CodedAttribute, GaussianPlaces};
pub use backdrop::Backdrop;
pub use context::*;
pub use entropy::*;
pub use gpu_error::GpuError;
pub use light4gs_render::spherical_harmonics;
pub use planes::*;
pub use read_backs::ReadBacks;
pub use scene::*;
pub use sensitivity::Sensitivity;
pub use sh::*;
pub use significance::{PixelContribution, Significance, VolumeWeight, least_significant};
pub use splatter::{Rendering, Splatter};
