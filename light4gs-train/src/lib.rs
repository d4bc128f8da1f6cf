//! Training, evaluation and the command line of Light4GS.

pub mod benchmark;
pub mod cli;
pub mod compression;
pub mod config;
pub mod density;
pub mod device;
pub mod error;
pub mod evaluation;
pub mod observers;
pub mod optimization;
pub mod report;
pub mod trainer;
pub mod video;
