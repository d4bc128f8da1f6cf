//! `bench`: the tables of `light4gs_lab::benchmark` and `light4gs_lab::benchmark::codec`.

use std::path::PathBuf;

use clap::Args;
use light4gs_lab::benchmark::codec::{codec_benchmark, codec_table};
use light4gs_lab::benchmark::{BenchScene, benchmark, table};
use light4gs_train::config::DeviceName;
use light4gs_train::device;
use light4gs_train::error::TrainError;

use super::output::{say, say_json};

#[derive(Debug, Args)]
pub(super) struct Bench {
    /// Back ends, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "ndarray,flex")]
    device: Vec<DeviceName>,
    /// A scene file instead of generated ones (layout: docs/benchmarks.md).
    #[arg(long, value_name = "FILE.safetensors", conflicts_with_all = ["gaussians", "size"])]
    scene: Vec<PathBuf>,
    /// Gaussians of the generated scenes.
    #[arg(long, value_delimiter = ',', default_value = "5000,20000,100000", allow_negative_numbers = true)]
    gaussians: Vec<usize>,
    /// Widths and heights of the generated scenes' images.
    #[arg(long, value_delimiter = ',', default_value = "400,800", allow_negative_numbers = true)]
    size: Vec<u32>,
    /// Timed repetitions of each part, after two untimed ones.
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..=10_000), allow_negative_numbers = true)]
    repeats: u32,
    /// Time the entropy coders instead, on a scene of the paper's size.
    #[arg(long, conflicts_with_all = ["scene", "gaussians", "size", "device"])]
    codec: bool,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

impl Bench {
    pub(super) fn run(self) -> Result<(), TrainError> {
        if self.codec {
            let times = codec_benchmark(self.repeats as usize)?;
            if self.json {
                say_json(&times)?;
            } else {
                say(codec_table(&times))?;
            }
            return Ok(());
        }
        let mut scenes = Vec::new();
        for path in &self.scene {
            scenes.push(BenchScene::open(path)?);
        }
        if scenes.is_empty() {
            if self.gaussians.iter().any(|count| !(1..=10_000_000).contains(count)) {
                return Err(TrainError::Input("--gaussians must be between 1 and 10000000".into()));
            }
            if self.size.iter().any(|size| !(1..=16_384).contains(size)) {
                return Err(TrainError::Input("--size must be between 1 and 16384".into()));
            }
            let sizes = self.size.clone();
            scenes.extend(
                self.gaussians
                    .iter()
                    .flat_map(|count| sizes.iter().map(move |size| BenchScene::generate(*count, *size))),
            );
        }
        let mut results = Vec::new();
        for name in self.device {
            let device = device::open(name)?;
            results.push(benchmark(name, &device, &scenes, self.repeats as usize)?);
        }
        if self.json {
            say_json(&results)?;
        } else {
            say(table(&results))?;
        }
        Ok(())
    }
}
