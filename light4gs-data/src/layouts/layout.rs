//! The requirements of a dataset layout.

use crate::error::DataError;
use crate::options::LoadOptions;
use crate::scene::Scene;
use std::path::Path;

/// A dataset layout: how cameras, times, images and points lie in a folder.
///
/// A layout reads metadata only. Images stay on disk until [`crate::ImageStore`] decodes them, so
/// [`open`](Self::open) is quick even for a large capture.
///
/// A layout of this crate is one file in `layouts/`, and its line in `layouts/mod.rs`. A layout of another
/// crate is added to a [`Layouts`](crate::Layouts), without changes here: see `examples/own_dataset_layout.rs` of the
/// repository.
pub trait DatasetLayout: Send + Sync {
    /// Lower-case name, unique among the layouts: for [`LoadOptions::layout`] and [`Scene::layout`].
    fn name(&self) -> &'static str;

    /// The file or files by which the layout is recognized, for the message when a folder holds no known one.
    fn signature(&self) -> &'static str;

    /// Whether the folder `root` has this layout. It looks for files only; a damaged dataset is still detected, so that
    /// [`open`](Self::open) can say what is wrong with it.
    fn detect(&self, root: &Path) -> bool;

    /// Reads the metadata of the dataset in the folder `root`. `options` have been checked.
    ///
    /// Cameras have the size that [`LoadOptions::resolution`] asks for, and times are in `[0, 1]`. [`Scene::new`] adds
    /// what follows from the frames.
    ///
    /// # Errors
    /// [`DataError`] naming the file, the field, what was expected and the remedy.
    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError>;
}
