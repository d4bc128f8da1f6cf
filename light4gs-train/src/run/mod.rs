//! A run on disk: its folder and its checkpoints.

mod checkpoint;
mod run_folder;

pub use checkpoint::{Checkpoint, list_checkpoints};
pub use run_folder::{RunFolder, RunRecord};
