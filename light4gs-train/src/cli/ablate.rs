//! `ablate`.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use light4gs_data::write_atomically;

use super::output::{say, say_json};
use super::train::{RunOutput, train_to_evaluation};
use crate::config::DeviceName;
use crate::error::TrainError;
use crate::evaluation::ablation::{AblationRow, AblationTable, to_markdown};

#[derive(Debug, Args)]
pub(super) struct Ablate {
    /// Folder of the dataset.
    scene: PathBuf,
    /// Which table.
    #[arg(long, value_enum)]
    table: AblationTable,
    /// The preset or TOML file that every variant is laid over.
    #[arg(long, default_value = "dnerf-small", value_name = "PRESET|FILE")]
    config: String,
    /// Folder for the runs, one folder each, and for table.md. Runs that are finished are not repeated, and variants that
    /// differ only in how the file is written are trained once.
    #[arg(long)]
    out: PathBuf,
    /// Changes one key of every variant's configuration; may be given more than once.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Back end: ndarray, flex, wgpu, or wgpu with an adapter such as wgpu:0.
    #[arg(long)]
    device: Option<DeviceName>,
    #[command(flatten)]
    output: RunOutput,
}

impl Ablate {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let mut overrides = self.overrides;
        overrides.extend(self.device.map(|device| format!("device={device}")));
        let variants = self.table.variants();
        // All configurations are checked before the first run begins.
        let configs =
            variants.iter().map(|variant| variant.config(&self.config, &overrides)).collect::<Result<Vec<_>, _>>()?;
        std::fs::create_dir_all(&self.out).map_err(|source| light4gs_data::DataError::Io {
            action: "create",
            path: self.out.clone(),
            source,
        })?;
        let mut rows = Vec::new();
        for (i, (variant, config)) in variants.iter().zip(&configs).enumerate() {
            if !self.output.quiet && !self.output.json {
                say(variant.name)?;
            }
            let folder = self.out.join(variant.name);
            let like = configs[..i].iter().position(|earlier| earlier.trains_like(config));
            let like = like.map(|i| self.out.join(variants[i].name));
            let evaluation = train_to_evaluation(config.clone(), &self.scene, &folder, like.as_deref(), &self.output)?;
            rows.push(AblationRow::new(variant.name, &evaluation));
            // After every run, so that an interrupted table shows what there is.
            let path = self.out.join("table.md");
            write_atomically(&path, |file| file.write_all(to_markdown(&rows).as_bytes()))?;
        }
        if self.output.json {
            say_json(&rows)?;
        } else {
            say(to_markdown(&rows))?;
        }
        Ok(())
    }
}
