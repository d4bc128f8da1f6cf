//! A run on disk: its folder and its checkpoints.

mod checkpoint;
mod comparison;
mod contents;
mod lock;
mod run_folder;
mod stored_tensors;

pub use checkpoint::{Checkpoint, SaveError, checkpoint_name, list_checkpoints};
pub use comparison::{Comparison, Difference};
pub use contents::belongs_to_run;
pub use run_folder::{RunFolder, RunRecord};
