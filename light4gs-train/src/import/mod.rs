//! Scenes that other programs have trained.
//!
//! - this file: the result of an import, and how it becomes a run
//! - [`mod@reference`]: checkpoints of 4DGaussians, and of the public code of Light4GS
//! - [`still`]: plain Gaussians without motion, from a PLY file
//! - `bounds`, `extent`: values that would cost all others their precision; middle and size of a scene
//! - `settings`: the switches in 4DGaussians' `cfg_args`
//! - `views`: cameras around a scene without a dataset

mod bounds;
mod extent;
pub mod reference;
mod settings;
pub mod still;
mod views;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use light4gs_model::{DeformationConfig, DynamicScene, HexPlaneConfig, HexPlaneField, HexPlaneFieldConfig};

pub use views::scene_around;

use crate::config::Config;
use crate::error::TrainError;
use crate::optimization::adam::Adam;
use crate::run::{Checkpoint, RunFolder, SaveError, checkpoint_name};
use crate::stage::Stage;

/// A scene with motion, as another program has trained it.
#[derive(Debug)]
pub struct ImportedScene {
    /// The model, which renders like that of the other program.
    pub scene: DynamicScene<HexPlaneField>,
    /// Color behind the Gaussians.
    pub background: [f32; 3],
    /// Folder of the files.
    pub source: PathBuf,
}

impl ImportedScene {
    /// The configuration of a run with this model, starting from a base.
    ///
    /// # Errors
    /// [`TrainError::Config`] for sizes that a run cannot have, such as planes whose resolution is no multiple of 4.
    pub fn config(&self, base: &Config) -> Result<Config, TrainError> {
        let mut config = base.clone();
        let planes = HexPlaneConfig::of(&self.scene.field.hexplane).expect("what is imported has a hexplane");
        let deformation = &self.scene.field.deformation;
        config.model.sh_degree = self.scene.gaussians.sh_degree() as u8;
        config.model.fields.hexplane = HexPlaneFieldConfig {
            hexplane: planes,
            deformation: DeformationConfig {
                width: deformation.trunk[0].weight.dims()[1],
                depth: deformation.trunk.len(),
                position: deformation.position.is_some(),
                scale: deformation.scale.is_some(),
                rotation: deformation.rotation.is_some(),
                opacity: deformation.opacity.is_some(),
                sh: deformation.sh.is_some(),
                differentiate_points: false,
            },
        };
        config.data.background = self.background;
        // Entropy models are fitted when the scene is encoded.
        config.compression.rate.lambda = 0.0;
        config.train.prune.fraction = 0.0;
        config.validate()?;
        Ok(config)
    }

    /// Writes a run that ends with this model. `encode` then makes the file, and `eval` measures it.
    ///
    /// # Errors
    /// As [`ImportedScene::config`] and [`RunFolder::create`]; [`TrainError::Checkpoint`] for numbers that are not finite.
    pub fn write_run(
        self,
        root: &Path,
        dataset: Option<&Path>,
        base: &Config,
        overwrite: bool,
    ) -> Result<RunFolder, TrainError> {
        let config = self.config(base)?;
        let folder = RunFolder::create(root, dataset, &config, overwrite)?;
        let iteration = config.train.fine_iterations;
        let state: Checkpoint<HexPlaneField> = Checkpoint {
            scene: self.scene,
            compression: None,
            adam: Adam::default(),
            density: BTreeMap::new(),
            corrections: BTreeMap::new(),
            stage: Stage::Fine,
            iteration,
            seconds: 0.0,
            rate_weight: 1.0,
        };
        let name = checkpoint_name(Stage::Fine, iteration);
        let path = folder.checkpoints().join(name);
        state.save(&path).map_err(|error| match error {
            SaveError::Other(error) => error,
            not_finite => TrainError::Checkpoint { path, problem: not_finite.to_string() },
        })?;
        Ok(folder)
    }
}
