//! `quickstart`.

use std::path::PathBuf;

use clap::Args;
use light4gs_data::{SyntheticOptions, write_synthetic};
use light4gs_train::config::{Config, DeviceName};
use light4gs_train::error::TrainError;

use super::train::{RunOutput, train};

#[derive(Debug, Args)]
pub(super) struct Quickstart {
    /// Folder of the run. The dataset is made beside this folder, in a folder with the same name and the suffix
    /// `-scene`.
    #[arg(long, default_value = "runs/quickstart")]
    out: PathBuf,
    /// Back end: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long, default_value_t = DeviceName::Flex)]
    device: DeviceName,
    /// Replace an existing run.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    output: RunOutput,
}

impl Quickstart {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let config = Config { device: self.device, ..Config::from_preset("quickstart")? };
        let mut scene = self.out.clone().into_os_string();
        scene.push("-scene");
        let scene = PathBuf::from(scene);
        if !scene.exists() {
            if let Some(parent) = scene.parent() {
                std::fs::create_dir_all(parent).map_err(|source| light4gs_data::DataError::Io {
                    action: "create",
                    path: parent.into(),
                    source,
                })?;
            }
            write_synthetic(&scene, &SyntheticOptions::default())?;
        }
        train(config, &scene, &self.out, self.overwrite, &self.output)
    }
}
