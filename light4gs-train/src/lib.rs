//! Training, evaluation and the command line of Light4GS.

pub mod benchmark;
#[cfg(feature = "cli")]
pub mod cli;
pub mod compression;
pub mod config;
pub mod dataset;
pub mod density;
pub mod device;
pub mod divergence;
pub mod error;
pub mod evaluation;
pub mod import;
pub mod loss;
pub mod memory;
pub mod metrics;
pub mod observers;
pub mod optimization;
pub mod pace;
mod randomness;
pub mod regularizer;
pub mod report;
pub mod run;
pub mod sampling;
mod stage;
pub mod study;
pub mod trainer;
mod utc;
pub mod video;
pub mod view;

pub use stage::Stage;
