//! What the examples share: a tiny synthetic scene to try things on.

use light4gs_data::{DataError, SyntheticOptions, write_synthetic};
use std::path::{Path, PathBuf};

/// Errors of an example: any.
pub type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Writes the procedural scene of the quickstart into `folder`, small: 12 training and 2 test images of 48 × 48 pixels
/// in the D-NeRF layout. Returns the scene's folder.
///
/// # Errors
/// [`DataError`] when it cannot be written.
pub fn tiny_scene(folder: &Path) -> Result<PathBuf, DataError> {
    let root = folder.join("scene");
    let options = SyntheticOptions { resolution: 48, train_frames: 12, test_frames: 2, val_frames: 0, seed: 0 };
    write_synthetic(&root, &options)?;
    Ok(root)
}
