//! The built-in deformation fields as one type, from which a configuration or a file chooses when the program runs.

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use light4gs_codec::MotionArrays;
use light4gs_keys::choice;

use super::hexplane::HexPlaneField;
use super::nodes::NodesField;
use super::still::StillField;
use super::{DeformationField, FinePosition, LearningRate, Moment, SceneAtRest, ScenePoints};
use crate::planes::FeaturePlanes;
use crate::scene::{Attribute, GaussianTensors, ModelError};

/// Declares the names of several fields with their keys, and makes one field type of them. Each call is passed to the field
/// that a value holds.
macro_rules! built_in_fields {
    ($($(#[doc = $about:literal])+ $(#[serde $serde:tt])? $variant:ident = $name:ident: $field:ident,)+) => {
        choice! {
            /// The built-in deformation fields.
            pub enum FieldKind: "field" {
                $(
                    $(#[doc = $about])+
                    $(#[serde $serde])?
                    $variant = $name: <$field as DeformationField>::Config,
                )+
            }
            /// The keys of the built-in deformation fields.
            pub struct FieldConfigs: enum BuiltInFieldConfig;
        }

        /// One of the built-in deformation fields. Paths of its parameters are those of the field that it holds.
        ///
        /// ```
        /// use burn::tensor::Device;
        /// use light4gs_model::{BuiltInField, BuiltInFieldConfig, DeformationField};
        ///
        /// let field = BuiltInField::init(&BuiltInFieldConfig::Still(()), &Device::flex());
        /// assert_eq!(field.kind(), "");
        /// assert!(field.planes().is_none());
        /// ```
        // A scene has only one of these, so its size does not matter.
        #[allow(clippy::large_enum_variant)]
        #[derive(Module, Debug)]
        pub enum BuiltInField {
            $($(#[doc = $about])+ $variant($field),)+
        }

        /// Evaluates an expression with the field that a value holds.
        macro_rules! each {
            ($self:expr, $it:ident => $result:expr) => {
                match $self {
                    $(BuiltInField::$variant($it) => $result,)+
                }
            };
        }

        impl DeformationField for BuiltInField {
            type Config = BuiltInFieldConfig;

            const KINDS: &'static [&'static str] = &[$($field::KINDS[0]),+];

            fn attributes(config: &BuiltInFieldConfig) -> Vec<Attribute> {
                match config {
                    $(BuiltInFieldConfig::$variant(config) => $field::attributes(config),)+
                }
            }

            fn init(config: &BuiltInFieldConfig, device: &Device) -> Self {
                match config {
                    $(BuiltInFieldConfig::$variant(config) => Self::$variant($field::init(config, device)),)+
                }
            }

            fn from_arrays(arrays: &MotionArrays, planes: Option<FeaturePlanes>, device: &Device) -> Result<Self, ModelError> {
                $(if $field::KINDS.contains(&arrays.kind.as_str()) {
                    return $field::from_arrays(arrays, planes, device).map(Self::$variant);
                })+
                Err(ModelError::kind(&arrays.kind, Self::KINDS))
            }

            fn deform(&self, canonical: GaussianTensors, points: ScenePoints<'_>, time: f32) -> GaussianTensors {
                each!(self, field => field.deform(canonical, points, time))
            }

            fn kind(&self) -> &'static str {
                each!(self, field => field.kind())
            }

            fn begin_motion(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
                each!(self, field => field.begin_motion(scene, position));
            }

            fn begin_step(&mut self, scene: &SceneAtRest<'_>, position: &FinePosition) {
                each!(self, field => field.begin_step(scene, position));
            }

            fn passing(&self, attribute: &Attribute, moment: &Moment) -> Option<Vec<f32>> {
                each!(self, field => field.passing(attribute, moment))
            }

            fn regularizer(&self, scene: &SceneAtRest<'_>, position: &FinePosition) -> Option<Tensor<1>> {
                each!(self, field => field.regularizer(scene, position))
            }

            fn learning_rate(&self, path: &str, usual: LearningRate) -> LearningRate {
                each!(self, field => field.learning_rate(path, usual))
            }

            fn resize(&mut self, shapes: &BTreeMap<String, Vec<usize>>) -> Result<(), ModelError> {
                each!(self, field => field.resize(shapes))
            }

            fn planes(&self) -> Option<&FeaturePlanes> {
                each!(self, field => field.planes())
            }

            fn planes_mut(&mut self) -> Option<&mut FeaturePlanes> {
                each!(self, field => field.planes_mut())
            }

            fn to_arrays(&self) -> Result<MotionArrays, ModelError> {
                each!(self, field => field.to_arrays())
            }
        }
    };
}

built_in_fields! {
    /// The paper's field: a multiscale hexplane and a network.
    #[serde(flatten)]
    HexPlane = hexplane: HexPlaneField,
    /// Control nodes, which Gaussians follow.
    Nodes = nodes: NodesField,
    /// Nothing moves.
    Still = still: StillField,
}
