//! Dataset layouts: [`DatasetLayout`] is the seam, [`Layouts`] the list of those that are known.
//!
//! To add a layout to this crate: its own file in this folder, its `mod` line and its place in [`Layouts::default`],
//! and a preset in `light4gs-train/configs/`, whose presence a test checks.

pub(crate) mod colmap;
mod dnerf;
mod layout;
mod nerfies;
mod nerfstudio;
mod neu3d;
pub(crate) mod shared;
#[cfg(test)]
pub(crate) mod written;

pub use colmap::Colmap;
pub use dnerf::DNerf;
pub use layout::DatasetLayout;
pub use nerfies::{HyperNerf, NerfDs};
pub use nerfstudio::Nerfstudio;
pub use neu3d::Neu3d;

use crate::duration::seconds_at_rate;
use crate::error::DataError;
use crate::options::LoadOptions;
use crate::scene::Scene;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// The layouts that are tried, in this order, when a folder is opened. Clones are cheap.
///
/// ```
/// use light4gs_data::Layouts;
///
/// assert_eq!(Layouts::default().names(), ["dnerf", "neu3d", "nerfds", "hypernerf", "nerfstudio", "colmap"]);
/// ```
#[derive(Clone)]
pub struct Layouts {
    list: Vec<Arc<dyn DatasetLayout>>,
}

impl Default for Layouts {
    /// The layouts of this crate. If two match the same folder, the more specific one comes first.
    fn default() -> Self {
        Self {
            list: vec![
                Arc::new(DNerf),
                Arc::new(Neu3d),
                Arc::new(NerfDs),
                Arc::new(HyperNerf),
                Arc::new(Nerfstudio),
                Arc::new(Colmap),
            ],
        }
    }
}

impl fmt::Debug for Layouts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Layouts").field(&self.names()).finish()
    }
}

impl Layouts {
    /// The same list with another layout in front: it is tried first, and replaces one of the same name.
    pub fn with(mut self, layout: impl DatasetLayout + 'static) -> Self {
        self.list.retain(|known| known.name() != layout.name());
        self.list.insert(0, Arc::new(layout));
        self
    }

    /// The names of the layouts, in the order in which they are tried.
    pub fn names(&self) -> Vec<&'static str> {
        self.list.iter().map(|layout| layout.name()).collect()
    }

    /// The layout of a folder, found by its content.
    ///
    /// # Errors
    /// [`DataError::Io`] when there is no such folder; [`DataError::UnknownLayout`] when it holds none of the layouts.
    pub fn detect(&self, root: &Path) -> Result<&dyn DatasetLayout, DataError> {
        let kind = std::fs::metadata(root).map_err(DataError::io("open the folder", root))?;
        if let Some(layout) = self.list.iter().find(|layout| layout.detect(root)) {
            return Ok(layout.as_ref());
        }
        let problem = if kind.is_dir() {
            let expected = self.list.iter().map(|layout| format!("{} ({})", layout.signature(), layout.name()));
            format!("expected {}", expected.collect::<Vec<_>>().join(", or "))
        } else {
            "it is a file, expected a folder".into()
        };
        let remedy = "name the folder that holds the dataset".into();
        Err(DataError::UnknownLayout { path: root.to_path_buf(), problem, remedy })
    }

    /// The layout with a name.
    ///
    /// # Errors
    /// [`DataError::Options`] with the known names.
    pub fn by_name(&self, name: &str) -> Result<&dyn DatasetLayout, DataError> {
        let found = self.list.iter().find(|layout| layout.name() == name);
        found.map(AsRef::as_ref).ok_or_else(|| DataError::Options {
            option: "layout",
            problem: format!("`{name}` is not known, expected {}", self.names().join(", ")),
        })
    }
}

impl Scene {
    /// Reads the metadata of a dataset in one of the layouts of this crate; images are checked for presence, and their
    /// headers as far as the sizes are needed.
    ///
    /// # Errors
    /// [`DataError`] naming the file, the field, what was expected and the remedy.
    pub fn open(root: &Path, options: &LoadOptions) -> Result<Self, DataError> {
        Self::open_with(&Layouts::default(), root, options)
    }

    /// As [`Self::open`], with further layouts: `Layouts::default().with(MyLayout)`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(layouts: &Layouts, root: &Path, options: &LoadOptions) -> Result<Self, DataError> {
        options.check()?;
        let layout = match &options.layout {
            Some(name) => layouts.by_name(name)?,
            None => layouts.detect(root)?,
        };
        let mut scene = layout.open(root, options)?.with_usable_points(options.most_points);
        if let Some(rate) = options.frames_a_second {
            // Before times are moved: cameras that are out of step would count as further frames.
            scene.seconds = seconds_at_rate(&scene.times(), rate);
        }
        if options.synchronize {
            scene.put_in_step(options)?;
        }
        if let Some([from, to]) = options.between {
            scene = scene.between(from, to)?;
        }
        if let Some(times) = options.most_times {
            scene = scene.thinned(times);
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A layout that detects a marker file and refuses to open, naming itself.
    struct Marked(&'static str);

    impl DatasetLayout for Marked {
        fn name(&self) -> &'static str {
            self.0
        }

        fn signature(&self) -> &'static str {
            "marker.txt"
        }

        fn detect(&self, root: &Path) -> bool {
            root.join("marker.txt").is_file()
        }

        fn open(&self, root: &Path, _: &LoadOptions) -> Result<Scene, DataError> {
            Err(DataError::field(root, self.0, "opened", "nothing"))
        }
    }

    fn message(layouts: &Layouts, root: &Path, layout: Option<&str>) -> String {
        let options = LoadOptions { layout: layout.map(Into::into), ..Default::default() };
        Scene::open_with(layouts, root, &options).unwrap_err().to_string()
    }

    #[test]
    fn a_layout_of_another_crate_is_tried_first_and_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let layouts = Layouts::default().with(Marked("a")).with(Marked("b"));
        assert_eq!(layouts.names()[..3], ["b", "a", "dnerf"]);
        let unknown = message(&layouts, root, None);
        assert!(unknown.contains("marker.txt (a)") && unknown.contains("transforms_train.json (dnerf)"), "{unknown}");
        std::fs::write(root.join("marker.txt"), "").unwrap();
        assert!(message(&layouts, root, None).contains(": b: opened"));
        assert!(message(&layouts, root, Some("a")).contains(": a: opened"));
        let named = message(&layouts, root, Some("blurays"));
        assert!(named.contains("`blurays`") && named.contains("b, a, dnerf"), "{named}");
        assert_eq!(layouts.with(Marked("dnerf")).names()[..4], ["dnerf", "b", "a", "neu3d"]);
    }

    #[test]
    fn folders_without_a_dataset_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let unknown = Scene::open(folder.path(), &LoadOptions::default()).unwrap_err();
        assert!(unknown.to_string().contains("transforms_train.json"), "{unknown}");
        let missing = Scene::open(&folder.path().join("no"), &LoadOptions::default());
        assert!(matches!(missing, Err(DataError::Io { .. })));
        let file = folder.path().join("a.txt");
        std::fs::write(&file, "").unwrap();
        assert!(Scene::open(&file, &LoadOptions::default()).unwrap_err().to_string().contains("expected a folder"));
    }
}
