//! The whole model: Gaussians, their frame, and how they move.

use burn::config::Config;
use burn::module::Module;
use burn::tensor::{Device, Tensor, s};
use light4gs_data::PointCloud;

use super::coordinates::{Pca, SceneCoordinates};
use super::deformation::{Deformation, DeformationConfig};
use super::gaussians::{GaussianTensors, Gaussians, GaussiansConfig};
use super::hexplane::{HexPlane, HexPlaneConfig};

/// Configuration of a [`DynamicScene`].
#[derive(Config, Debug)]
pub struct DynamicSceneConfig {
    /// The Gaussians.
    pub gaussians: GaussiansConfig,
    /// The planes.
    pub hexplane: HexPlaneConfig,
    /// The network; its `feature_size` is set from the planes.
    pub deformation: DeformationConfig,
    /// Whether the query's gradient reaches the positions (the reference detaches them).
    #[config(default = true)]
    pub differentiate_points: bool,
}

impl DynamicSceneConfig {
    /// A model over a cloud, whose principal axes become the scene's frame.
    pub fn init(&self, cloud: &PointCloud, device: &Device) -> DynamicScene {
        let hexplane = self.hexplane.init(device);
        let mut deformation = self.deformation.clone();
        deformation.feature_size = hexplane.feature_size();
        DynamicScene {
            gaussians: self.gaussians.init(cloud, device),
            coordinates: SceneCoordinates::new(&Pca::fit(&cloud.positions), device),
            hexplane,
            deformation: deformation.init(device),
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
/// let hexplane = HexPlaneConfig::new().with_channels(4).with_resolution([8, 8, 8, 4]);
/// let config = DynamicSceneConfig::new(GaussiansConfig::new(), hexplane, DeformationConfig::new(0).with_width(16));
/// let scene = config.init(&cloud, &Device::flex());
/// assert_eq!(scene.at(0.25).means.dims(), [3, 3]);
/// ```
#[derive(Module, Debug)]
pub struct DynamicScene {
    /// At rest.
    pub gaussians: Gaussians,
    /// From world coordinates to the planes'.
    pub coordinates: SceneCoordinates,
    /// Features over space and time.
    pub hexplane: HexPlane,
    /// From features to changes.
    pub deformation: Deformation,
    /// Whether the query's gradient reaches the positions.
    pub differentiate_points: bool,
}

impl DynamicScene {
    /// Raw attributes at a time in [0, 1].
    pub fn at(&self, time: f32) -> GaussianTensors {
        let rest = self.gaussians.tensors();
        if self.gaussians.is_empty() {
            // Dense layers of some back ends refuse a batch of none.
            return rest;
        }
        let points = self.query_points(rest.means.clone(), time);
        self.deform(rest, self.hexplane.query(points))
    }

    /// Hexplane coordinates `[N, 4]` of world points `[N, 3]` at a time in [0, 1].
    pub fn query_points(&self, means: Tensor<2>, time: f32) -> Tensor<2> {
        let means = if self.differentiate_points { means } else { means.detach() };
        let [count, _] = means.dims();
        let time = Tensor::full([count, 1], 2.0 * time - 1.0, &means.device());
        Tensor::cat(vec![self.coordinates.normalize(means), time], 1)
    }

    /// Adds the network's output at features `[N, F]` to raw attributes.
    pub fn deform(&self, rest: GaussianTensors, features: Tensor<2>) -> GaussianTensors {
        let offsets = self.deformation.forward(features);
        fn add<const D: usize>(attribute: Tensor<D>, offset: Option<Tensor<D>>) -> Tensor<D> {
            match offset {
                Some(offset) => attribute + offset,
                None => attribute,
            }
        }
        let coefficients = rest.sh_rest.dims()[1] + 1;
        let (dc, other) = match offsets.sh {
            Some(sh) => (Some(sh.clone().slice(s![.., 0..1, ..])), Some(sh.slice(s![.., 1..coefficients, ..]))),
            None => (None, None),
        };
        GaussianTensors {
            means: add(rest.means, offsets.position),
            log_scales: add(rest.log_scales, offsets.scale),
            quats: add(rest.quats, offsets.rotation),
            opacity_logits: add(rest.opacity_logits, offsets.opacity),
            sh_dc: add(rest.sh_dc, dc),
            sh_rest: add(rest.sh_rest, other),
        }
    }
}
