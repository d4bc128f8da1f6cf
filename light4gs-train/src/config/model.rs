//! `[model]`: what is trained.

use std::path::PathBuf;

use light4gs_keys::Bounds::{Text, Whole};
use light4gs_keys::{keys, optional};
use light4gs_model::{
    BuiltInFieldConfig, CoordinatesConfig, DeformationField, DynamicSceneConfig, FieldConfigs, FieldKind,
    GaussiansConfig,
};

keys! {
    /// The model: the Gaussians and their motion.
    pub struct ModelConfig {
        /// Highest degree of the spherical harmonics, 0 to 3.
        sh_degree: u8 = 3; Whole { least: 0, most: 3 }, "3DGS";
        /// What moves the Gaussians. The keys of each field are in the tables below.
        field: FieldKind = FieldKind::HexPlane; FieldKind::BOUNDS, "paper";
        /// A `.l4gs` file of a scene that stands still. The Gaussians of this scene are drawn together with the run's
        /// own, but are not trained. A relative path starts at the folder of the run. Empty means no such file. `train
        /// --segment` sets this key for the segments of a take.
        #[serde(with = "optional")]
        base: Option<PathBuf> = None; Text, "ours";
        /// From world coordinates to those of the planes.
        coordinates: CoordinatesConfig;
        /// The keys of the deformation fields.
        #[serde(flatten)]
        fields: FieldConfigs;
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
        DynamicSceneConfig::new(gaussians, field)
            .with_coordinates(self.coordinates.clone())
            .with_differentiate_points(self.fields.hexplane.deformation.differentiate_points)
    }

    /// The built-in deformation field that is chosen, with its keys.
    pub fn field(&self) -> BuiltInFieldConfig {
        self.fields.of(self.field)
    }
}
