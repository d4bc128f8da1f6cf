//! Training, evaluation and the command line of Light4GS.

pub mod ablation;
pub mod benchmark;
pub mod checkpoint;
pub mod cli;
pub mod codec_benchmark;
pub mod compression;
pub mod config;
pub mod densification;
pub mod device;
pub mod error;
pub mod evaluation;
pub mod finish;
pub mod gradients;
pub mod learning_rates;
pub mod loss;
pub mod metrics_log;
pub mod optimizer;
pub mod parameters;
pub mod profile;
mod randomness;
pub mod report;
pub mod run_folder;
pub mod schedule;
pub mod table;
pub mod tensorboard;
pub mod trainer;
pub mod video;
