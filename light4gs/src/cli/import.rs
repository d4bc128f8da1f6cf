//! `import`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use light4gs_data::Scene;
use light4gs_model::attributes::MEANS;
use light4gs_train::compression::{ConfiguredModels, TrainedScene};
use light4gs_train::config::{Config, DeviceName};
use light4gs_train::dataset::{image_store, load_options};
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::import::still::{self, StillScene};
use light4gs_train::import::{reference, scene_around};

use super::check_output;
use super::container::code_to_file;
use super::output::{say, tell};

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Source {
    /// A checkpoint of 4DGaussians, or of the public code of Light4GS: the folder with `point_cloud.ply` and
    /// `deformation.pth`, or a folder above it. The import makes a run, for `encode` and `eval`.
    #[value(name = "4dgaussians")]
    FourDGaussians,
    /// A PLY file of 3DGS: Gaussians without motion. The import makes a .l4gs file.
    Ply,
}

#[derive(Debug, Args)]
pub(super) struct Import {
    /// The folder or the file that the other program has written.
    source: PathBuf,
    /// The kind of source.
    #[arg(long, value_enum)]
    from: Source,
    /// Folder of the new run, or for a PLY the .l4gs file to write.
    #[arg(long)]
    out: PathBuf,
    /// Folder of the dataset on which the scene was trained. With this option, the quantization steps are searched on
    /// training images; without it, on views around the scene.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// A preset or a TOML file that says how the scene is coded. The model itself comes from the source.
    #[arg(long, default_value = "imported", value_name = "PRESET|FILE")]
    config: String,
    /// Changes one key of the configuration; may be given more than once.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Back end: auto (a graphics card if there is one), flex or ndarray (both on the processor), wgpu, or wgpu with an adapter
    /// such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    /// Replace an existing run.
    #[arg(long)]
    overwrite: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

impl Import {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let mut config = Config::load(&self.config, &self.overrides)?;
        config.device = self.device.unwrap_or(config.device);
        match self.from {
            Source::FourDGaussians => self.import_reference(&config),
            Source::Ply => self.import_still(config),
        }
    }

    fn import_reference(&self, config: &Config) -> Result<(), TrainError> {
        let imported = reference::read(&self.source, &device::open(config.device)?)?;
        if let Some(dataset) = &self.scene {
            // Opened before the run's folder is made, so that a wrong path leaves nothing behind.
            Scene::open(dataset, &load_options(&imported.config(config)?))?;
        }
        let (count, source) = (imported.scene.gaussians.len(), imported.source.clone());
        imported.write_run(&self.out, self.scene.as_deref(), config, self.overwrite)?;
        let run = self.out.display();
        if self.json {
            return super::output::say_json(
                &serde_json::json!({"run": self.out, "source": source, "gaussians": count}),
            );
        }
        say(format_args!("{count} Gaussians from {} are a run in {run} now", source.display()))?;
        say(format_args!("make them small: light4gs encode {run} --out scene.l4gs"))
    }

    fn import_still(&self, mut config: Config) -> Result<(), TrainError> {
        if !self.out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("l4gs")) {
            let out = self.out.display();
            return Err(TrainError::Input(format!("--out {out} must end in .l4gs: a PLY becomes a file, not a run")));
        }
        if self.out.exists() && !self.overwrite {
            let out = self.out.display();
            return Err(TrainError::Input(format!("{out} exists already; give --overwrite to replace it")));
        }
        check_output(&self.out, &self.source)?;
        let device = device::open(config.device)?.autodiff();
        let StillScene { scene, notes, step_share } = still::read(&self.source, &device)?;
        for note in &notes {
            tell(format_args!("note: {note}"));
        }
        if let Some(step) = config.compression.attributes.step(MEANS).filter(|_| step_share < 1.0) {
            config.compression.attributes.steps.set(MEANS.name.as_ref(), step_share * f64::from(step));
        }
        config.model.sh_degree = scene.gaussians.sh_degree() as u8;
        let folder = self.source.parent().unwrap_or(Path::new("."));
        let mut data = match &self.scene {
            Some(dataset) => Scene::open(dataset, &load_options(&config))?,
            None => scene_around(&scene.gaussians.to_arrays(), folder, config.data.background)?,
        };
        if let Some(name) = self.source.file_stem() {
            data.name = name.to_string_lossy().into_owned();
        }
        let images = image_store(&config);
        let trained = TrainedScene {
            scene: &scene,
            compression: None,
            models: &ConfiguredModels,
            config: &config,
            data: &data,
            images: self.scene.is_some().then_some(&images),
            backdrop: None,
            device: &device,
        };
        code_to_file(&trained, &self.out, self.json).map(|_| ())
    }
}
