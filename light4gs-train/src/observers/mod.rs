//! What is written down while a run trains.

pub mod metrics_log;
pub mod tensorboard;
