//! The whole model: Gaussians, their coordinates, and the field that moves them.

use burn::module::Module;
use burn::tensor::Device;
use light4gs_data::PointCloud;

use super::coordinates::{CoordinatesConfig, SceneCoordinates};
use super::field::{BuiltInField, DeformationField, ScenePoints};
use super::gaussians::{GaussianTensors, Gaussians, GaussiansConfig};
use crate::planes::FeaturePlanes;

/// Configuration of a [`DynamicScene`].
#[derive(Clone, Debug)]
pub struct DynamicSceneConfig<F: DeformationField = BuiltInField> {
    /// The Gaussians.
    pub gaussians: GaussiansConfig,
    /// The field that moves them.
    pub field: F::Config,
    /// From world coordinates to the field's.
    pub coordinates: CoordinatesConfig,
    /// Whether the field's gradient reaches the positions (the reference detaches them).
    pub differentiate_points: bool,
}

impl<F: DeformationField> DynamicSceneConfig<F> {
    /// With gradients to the positions, and with the attributes that the field needs.
    pub fn new(mut gaussians: GaussiansConfig, field: F::Config) -> Self {
        gaussians.further.extend(F::attributes(&field));
        Self { gaussians, field, coordinates: CoordinatesConfig::default(), differentiate_points: true }
    }

    /// With these settings of the scene's coordinates.
    pub fn with_coordinates(mut self, coordinates: CoordinatesConfig) -> Self {
        self.coordinates = coordinates;
        self
    }

    /// Whether the field's gradient reaches the positions.
    pub fn with_differentiate_points(mut self, differentiate_points: bool) -> Self {
        self.differentiate_points = differentiate_points;
        self
    }

    /// A model over a cloud, from which the scene's coordinates are taken.
    pub fn init(&self, cloud: &PointCloud, device: &Device) -> DynamicScene<F> {
        DynamicScene {
            gaussians: self.gaussians.init(cloud, device),
            coordinates: SceneCoordinates::new(&self.coordinates.fit(&cloud.positions), device),
            field: F::init(&self.field, device),
            differentiate_points: self.differentiate_points,
        }
    }
}

/// Deformable Gaussians.
///
/// ```
/// use burn::tensor::Device;
/// use light4gs_data::PointCloud;
/// use light4gs_model::*;
///
/// let cloud = PointCloud { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]], colors: vec![[0.5; 3]; 3] };
/// let hexplane = HexPlaneConfig { channels: 4, resolution: [8, 8, 8, 4], ..Default::default() };
/// let field = HexPlaneFieldConfig { hexplane, deformation: DeformationConfig { width: 16, ..Default::default() } };
/// let config = DynamicSceneConfig::<HexPlaneField>::new(GaussiansConfig::new(), field);
/// let scene = config.init(&cloud, &Device::flex());
/// assert_eq!(scene.at(0.25).means.dims(), [3, 3]);
/// ```
#[derive(Module, Debug)]
pub struct DynamicScene<F: Module = BuiltInField> {
    /// The canonical Gaussians.
    pub gaussians: Gaussians,
    /// From world coordinates to the field's.
    pub coordinates: SceneCoordinates,
    /// The field that moves the Gaussians.
    pub field: F,
    /// Whether the field's gradient reaches the positions.
    pub differentiate_points: bool,
}

impl<F: DeformationField> DynamicScene<F> {
    /// Raw attributes at a time in [0, 1].
    pub fn at(&self, time: f32) -> GaussianTensors {
        let canonical = self.gaussians.tensors();
        if self.gaussians.is_empty() {
            // Dense layers of some back ends refuse an empty batch.
            return canonical;
        }
        let means = canonical.means.clone();
        let means = if self.differentiate_points { means } else { means.detach() };
        let constants = canonical.further.clone();
        let (points, time) = (ScenePoints::new(means, &self.coordinates), self.coordinates.field_time(time));
        self.field.deform(canonical, points, time).with_constants_of(&constants)
    }

    /// The field's planes, if it has any.
    pub fn planes(&self) -> Option<&FeaturePlanes> {
        self.field.planes()
    }

    /// The field's planes, if it has any, for replacing them.
    pub fn planes_mut(&mut self) -> Option<&mut FeaturePlanes> {
        self.field.planes_mut()
    }
}
