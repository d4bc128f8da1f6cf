//! `[model]`: what is trained.

use light4gs_model::{DeformationField, DynamicSceneConfig, GaussiansConfig, HexPlaneFieldConfig};
use serde::{Deserialize, Serialize};

/// Sizes and switches of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ModelConfig {
    /// Highest degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u8,
    /// From world coordinates to those of the planes.
    pub coordinates: CoordinatesConfig,
    /// The feature planes.
    pub hexplane: HexPlaneConfig,
    /// The network that turns features into motion.
    pub deformation: DeformationConfig,
}

/// What the coordinates in which the planes lie are made of (paper III-A).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CoordinatesConfig {
    /// Whether they lie along the principal axes of the initial cloud; else along the world's.
    pub pca: bool,
    /// Whether what lies outside of one standard deviation of the cloud is contracted; else the whole cloud is scaled into
    /// what is not.
    pub contraction: bool,
}

impl Default for CoordinatesConfig {
    fn default() -> Self {
        let light4gs_model::CoordinatesConfig { pca, contraction } = light4gs_model::CoordinatesConfig::default();
        Self { pca, contraction }
    }
}

/// Sizes of the multiscale hexplane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HexPlaneConfig {
    /// Features a plane.
    pub channels: usize,
    /// Resolution along x, y, z, t at the lowest scale; every one a multiple of 4.
    pub resolution: [usize; 4],
    /// One scale for each: its spatial resolution is the base times this. Time keeps its resolution.
    pub multipliers: Vec<usize>,
}

/// Sizes and heads of the deformation network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DeformationConfig {
    /// Width of the hidden layers.
    pub width: usize,
    /// Layers before the heads; 0 means the same as 1.
    pub depth: usize,
    /// Whether positions move.
    pub position: bool,
    /// Whether scales change.
    pub scale: bool,
    /// Whether rotations change.
    pub rotation: bool,
    /// Whether opacities change.
    pub opacity: bool,
    /// Whether spherical harmonics change.
    pub sh: bool,
    /// Whether positions get a gradient through the hexplane query as well.
    pub differentiate_points: bool,
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self {
            sh_degree: 3,
            coordinates: CoordinatesConfig::default(),
            hexplane: HexPlaneConfig::default(),
            deformation: DeformationConfig::default(),
        }
    }
}

impl Default for HexPlaneConfig {
    fn default() -> Self {
        let light4gs_model::HexPlaneConfig { channels, resolution, multipliers } =
            light4gs_model::HexPlaneConfig::new();
        Self { channels, resolution, multipliers }
    }
}

impl Default for DeformationConfig {
    fn default() -> Self {
        let network = light4gs_model::DeformationConfig::new(0);
        Self {
            width: network.width,
            depth: network.depth,
            position: network.position,
            scale: network.scale,
            rotation: network.rotation,
            opacity: network.opacity,
            sh: network.sh,
            differentiate_points: true,
        }
    }
}

impl ModelConfig {
    /// The Burn configuration that this stands for.
    pub fn build(&self) -> DynamicSceneConfig {
        self.scene(self.field())
    }

    /// The same with another deformation field.
    pub fn scene<F: DeformationField>(&self, field: F::Config) -> DynamicSceneConfig<F> {
        let gaussians = GaussiansConfig::new().with_sh_degree(usize::from(self.sh_degree));
        let CoordinatesConfig { pca, contraction } = self.coordinates;
        DynamicSceneConfig::new(gaussians, field)
            .with_coordinates(light4gs_model::CoordinatesConfig { pca, contraction })
            .with_differentiate_points(self.deformation.differentiate_points)
    }

    /// The built-in deformation field.
    pub fn field(&self) -> HexPlaneFieldConfig {
        let HexPlaneConfig { channels, resolution, multipliers } = self.hexplane.clone();
        let network = &self.deformation;
        let hexplane = light4gs_model::HexPlaneConfig::new()
            .with_channels(channels)
            .with_resolution(resolution)
            .with_multipliers(multipliers);
        let deformation =
            light4gs_model::DeformationConfig::new(channels.saturating_mul(self.hexplane.multipliers.len()))
                .with_width(network.width)
                .with_depth(network.depth)
                .with_position(network.position)
                .with_scale(network.scale)
                .with_rotation(network.rotation)
                .with_opacity(network.opacity)
                .with_sh(network.sh);
        HexPlaneFieldConfig::new(hexplane, deformation)
    }
}
