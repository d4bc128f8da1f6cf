//! Training, evaluation and the command line of Light4GS.

pub mod config;
pub mod metrics_log;
pub mod report;
pub mod table;
pub mod tensorboard;
pub mod video;
