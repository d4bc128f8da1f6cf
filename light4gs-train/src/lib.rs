//! Training and evaluation of Light4GS.

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
pub mod run;
pub mod sampling;
mod stage;
pub mod table;
pub mod trainer;
pub mod utc;
pub mod view_source;

pub use stage::Stage;
