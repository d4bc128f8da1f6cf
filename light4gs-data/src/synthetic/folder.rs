//! The folder that a synthetic dataset goes into.

use crate::atomic::make_folder_atomically;
use crate::error::DataError;
use std::fs;
use std::path::Path;

/// Makes the folder `root`, which must not exist, or be empty; its parents are made. `fill` fills it under a temporary name.
///
/// # Errors
/// [`DataError::Exists`] when `root` is there and not an empty folder; [`DataError::Options`] for a path without a name;
/// those of `fill`, and [`DataError::Io`].
pub(super) fn make_new_folder(root: &Path, fill: impl FnOnce(&Path) -> Result<(), DataError>) -> Result<(), DataError> {
    if root.file_name().is_none() {
        return Err(DataError::Options {
            option: "root",
            problem: format!("`{}` has no folder name of its own", root.display()),
        });
    }
    let empty_folder = match fs::symlink_metadata(root) {
        Ok(kind) if kind.is_dir() => {
            let mut entries = fs::read_dir(root).map_err(DataError::io("read", root))?;
            entries.next().is_none()
        }
        Ok(_) => false,
        Err(_) => true,
    };
    if !empty_folder {
        return Err(DataError::Exists { path: root.to_path_buf() });
    }
    if let Some(parent) = root.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(parent).map_err(DataError::io("create", parent))?;
    }
    make_folder_atomically(root, fill)
}
