//! `bench`: the tables of `light4gs_lab::benchmark` and `light4gs_lab::benchmark::codec`, or records of the same.

use std::fmt::Display;
use std::path::PathBuf;

use burn::tensor::Device;
use clap::Args;
use light4gs_lab::benchmark::codec::{codec_benchmark, codec_rows, codec_table};
use light4gs_lab::benchmark::host::{host_benchmark, host_rows, host_table};
use light4gs_lab::benchmark::{BenchScene, benchmark, rows, table};
use light4gs_lab::record::{Provenance, Record, Row};
use light4gs_train::config::DeviceName;
use light4gs_train::device;
use light4gs_train::error::TrainError;

use super::command_line::command_line;
use super::output::say;

#[derive(Debug, Args)]
pub(super) struct Bench {
    /// Back ends, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "ndarray,flex")]
    device: Vec<DeviceName>,
    /// A scene file, which is timed in place of generated scenes; docs/benchmarks.md says what it holds.
    #[arg(long, value_name = "FILE.safetensors", conflicts_with_all = ["gaussians", "size"])]
    scene: Vec<PathBuf>,
    /// Numbers of Gaussians of the generated scenes, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "5000,20000,100000", allow_negative_numbers = true)]
    gaussians: Vec<usize>,
    /// Sizes of the generated scenes' images in pixels, separated by commas; each size is both the width and the
    /// height.
    #[arg(long, value_delimiter = ',', default_value = "400,800", allow_negative_numbers = true)]
    size: Vec<u32>,
    /// Timed repetitions of each part, after two untimed ones.
    #[arg(long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..=10_000), allow_negative_numbers = true)]
    repeats: u32,
    /// Time the entropy coders instead, on a scene of the paper's size.
    #[arg(long, conflicts_with_all = ["scene", "gaussians", "size", "device"])]
    codec: bool,
    /// Instead, time what the CPU does during a training step on a GPU (100 Gaussians at 32×32), and count launches and
    /// read-backs.
    #[arg(long, conflicts_with_all = ["scene", "gaussians", "size", "codec"])]
    host: bool,
    /// Print as JSON, with command, commit, machine and date: the form of the files in `results/`.
    #[arg(long)]
    json: bool,
}

impl Bench {
    pub(super) fn run(self) -> Result<(), TrainError> {
        let repeats = self.repeats as usize;
        if self.codec {
            return output(self.json, &codec_benchmark(repeats)?, codec_table, codec_rows);
        }
        if self.host {
            let of = |(name, device)| host_benchmark(name, &device, repeats);
            let times: Result<Vec<_>, _> = self.device.into_iter().map(|name| opened(name).and_then(of)).collect();
            return output(self.json, &times?, host_table, host_rows);
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
        let of = |(name, device)| benchmark(name, &device, &scenes, repeats);
        let results: Result<Vec<_>, _> = self.device.into_iter().map(|name| opened(name).and_then(of)).collect();
        output(self.json, &results?, table, rows)
    }
}

fn opened(name: DeviceName) -> Result<(DeviceName, Device), TrainError> {
    Ok((name, device::open(name)?))
}

fn output<T, D: Display>(
    json: bool,
    results: &[T],
    table: fn(&[T]) -> D,
    rows: fn(&[T]) -> Vec<Row>,
) -> Result<(), TrainError> {
    if !json {
        return say(table(results));
    }
    say(Record { provenance: Provenance::of_this_program(command_line()), rows: rows(results) })
}
