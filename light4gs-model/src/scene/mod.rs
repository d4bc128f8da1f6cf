//! The scene (paper III-A): canonical Gaussians, and the field that moves them.
//!
//! World points are mapped to the field's coordinates ([`SceneCoordinates`]);
//! [`FeaturePlanes`](crate::FeaturePlanes) give a feature for a point and a time; [`Deformation`] turns the feature
//! into changes of the Gaussians' attributes; [`DynamicScene`] is the whole. [`regularizer`] keeps the planes smooth.

mod arrays;
pub mod attributes;
pub(crate) mod coordinates;
pub(crate) mod dynamic_scene;
pub(crate) mod field;
mod further;
pub(crate) mod gaussians;
pub mod regularizer;

pub use arrays::ModelError;
pub use attributes::Attribute;
pub use coordinates::{CoordinatesConfig, Pca, SceneCoordinates};
pub use dynamic_scene::{DynamicScene, DynamicSceneConfig};
pub use field::*;
pub use further::{FurtherParameters, FurtherTensor};
pub use gaussians::{ActivatedGaussians, AttributeMapper, GaussianTensors, Gaussians, GaussiansConfig};
