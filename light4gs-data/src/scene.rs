//! A scene: posed frames in splits, a point cloud, an extent; and how to open one.

use crate::dnerf;
use crate::error::DataError;
use crate::frame::Frame;
use crate::point_cloud::PointCloud;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A part of a scene's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Split {
    /// Frames to learn from.
    Train,
    /// Frames to judge on: never trained.
    Test,
    /// More frames to judge on; may be empty.
    Val,
    /// A camera path without pictures.
    Video,
}

impl Split {
    /// Every split.
    pub const ALL: [Self; 4] = [Self::Train, Self::Test, Self::Val, Self::Video];

    /// Lower-case name: `train`, `test`, `val`, `video`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
            Self::Val => "val",
            Self::Video => "video",
        }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Split {
    type Err = DataError;

    fn from_str(name: &str) -> Result<Self, DataError> {
        let found = Self::ALL.into_iter().find(|split| split.name() == name);
        found.ok_or_else(|| DataError::Options {
            option: "split",
            problem: format!("`{name}` is not known, expected train, test, val or video"),
        })
    }
}

/// A dataset layout on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Blender transforms with a time a frame, see [`crate::dnerf`].
    DNerf,
}

impl Format {
    /// Lower-case name, as in `--format`: `dnerf`.
    pub fn name(self) -> &'static str {
        match self {
            Self::DNerf => "dnerf",
        }
    }

    /// Finds the layout of a folder by its content.
    ///
    /// # Errors
    /// [`DataError::Io`] when there is no such folder; [`DataError::UnknownFormat`] when it holds
    /// none of the known layouts.
    pub fn detect(root: &Path) -> Result<Self, DataError> {
        let kind = std::fs::metadata(root).map_err(DataError::io("open the folder", root))?;
        if root.join("transforms_train.json").is_file() {
            return Ok(Self::DNerf);
        }
        let problem =
            if kind.is_dir() { "expected transforms_train.json (dnerf)" } else { "it is a file, expected a folder" };
        Err(DataError::UnknownFormat {
            path: root.to_path_buf(),
            problem: problem.into(),
            remedy: "name the folder that holds the dataset".into(),
        })
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Format {
    type Err = DataError;

    fn from_str(name: &str) -> Result<Self, DataError> {
        match name {
            "dnerf" | "synthetic" => Ok(Self::DNerf),
            _ => {
                Err(DataError::Options { option: "format", problem: format!("`{name}` is not known, expected dnerf") })
            }
        }
    }
}

/// The size at which pictures are used; cameras follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resolution {
    /// As in the files.
    #[default]
    Native,
    /// The longer side becomes this many pixels, the other follows; smaller pictures stay as they are.
    MaxSide(u32),
    /// Exactly `width` × `height` pixels, whatever the aspect.
    Exact {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
}

impl Resolution {
    /// The size (width, height) at which a picture of `source` = (width, height) pixels is used.
    pub fn apply(self, source: (u32, u32)) -> (u32, u32) {
        match self {
            Self::Native => source,
            Self::Exact { width, height } => (width, height),
            Self::MaxSide(limit) => {
                let longest = source.0.max(source.1);
                if longest <= limit {
                    return source;
                }
                let scaled = |side: u32| {
                    let exact = f64::from(side) * f64::from(limit) / f64::from(longest);
                    (exact.round() as u32).max(1)
                };
                (scaled(source.0), scaled(source.1))
            }
        }
    }
}

/// How to open a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// The layout; `None` finds it by content.
    pub format: Option<Format>,
    /// The size at which pictures are used.
    pub resolution: Resolution,
    /// What shows through transparent pixels: red, green, blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Seed of the random point cloud.
    pub seed: u64,
    /// Number of random points, where the dataset brings no point cloud.
    pub random_points: usize,
    /// Half the side of the cube of the random points, world units.
    pub random_half_size: f32,
}

impl Default for LoadOptions {
    /// Layout by content, native size, white background, 2000 random points in ±1.3, seed 0.
    fn default() -> Self {
        Self {
            format: None,
            resolution: Resolution::Native,
            background: [1.0; 3],
            seed: 0,
            random_points: 2000,
            random_half_size: 1.3,
        }
    }
}

impl LoadOptions {
    /// Refuses what no picture can have.
    fn check(&self) -> Result<(), DataError> {
        let bad = |option: &'static str, problem: String| Err(DataError::Options { option, problem });
        if self.background.iter().any(|v| !(0.0..=1.0).contains(v)) {
            let found = self.background;
            return bad("background", format!("{found:?}, expected three values from 0 to 1"));
        }
        match self.resolution {
            Resolution::MaxSide(0) | Resolution::Exact { width: 0, .. } | Resolution::Exact { height: 0, .. } => {
                return bad("resolution", "0 pixels, expected at least 1".into());
            }
            Resolution::Exact { width, height } if width.max(height) > 16384 => {
                return bad("resolution", format!("{width} x {height}, expected at most 16384"));
            }
            _ => {}
        }
        if self.random_points == 0 || self.random_points > 100_000_000 {
            let found = self.random_points;
            return bad("random_points", format!("{found}, expected 1 to 100000000"));
        }
        if !(self.random_half_size > 0.0 && self.random_half_size.is_finite()) {
            let found = self.random_half_size;
            return bad("random_half_size", format!("{found}, expected a positive number"));
        }
        Ok(())
    }
}

/// A dataset: cameras and times of every picture, where the Gaussians start, and how large it is.
///
/// Pictures stay on disk; [`crate::ImageStore`] reads them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The folder's name.
    pub name: String,
    /// The folder.
    pub root: PathBuf,
    /// Its layout.
    pub format: Format,
    /// Frames to learn from; at least one.
    pub train: Vec<Frame>,
    /// Frames to judge on; at least one.
    pub test: Vec<Frame>,
    /// More frames to judge on; may be empty.
    pub val: Vec<Frame>,
    /// A camera path without pictures.
    pub video: Vec<Frame>,
    /// What shows through transparent pixels: red, green, blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Where the Gaussians start.
    pub points: PointCloud,
    /// Mean of the training cameras' centres, world units.
    pub camera_mean: [f32; 3],
    /// 1.1 times the largest distance of a training camera's centre from their mean, world units
    /// (1 if they all coincide, since learning rates are multiplied by it).
    pub extent: f32,
}

impl Scene {
    /// Reads a dataset's metadata; pictures are checked for presence, and their headers as far as
    /// the sizes are needed.
    ///
    /// # Errors
    /// [`DataError`] naming the file, the field, what was expected and the remedy.
    pub fn open(root: &Path, options: &LoadOptions) -> Result<Self, DataError> {
        options.check()?;
        let format = match options.format {
            Some(format) => format,
            None => Format::detect(root)?,
        };
        match format {
            Format::DNerf => dnerf::read(root, options),
        }
    }

    /// The frames of a split.
    pub fn frames(&self, split: Split) -> &[Frame] {
        match split {
            Split::Train => &self.train,
            Split::Test => &self.test,
            Split::Val => &self.val,
            Split::Video => &self.video,
        }
    }
}

/// Mean of the cameras' centres, and 1.1 times the largest distance from it (1 if that is 0).
pub(crate) fn mean_and_extent(frames: &[Frame]) -> ([f32; 3], f32) {
    let centers: Vec<glam::DVec3> = frames.iter().map(|frame| frame.camera.center().as_dvec3()).collect();
    let mean = centers.iter().sum::<glam::DVec3>() / centers.len().max(1) as f64;
    let radius = centers.iter().fold(0.0f64, |largest, center| largest.max((*center - mean).length()));
    let extent = if radius > 0.0 { 1.1 * radius } else { 1.0 };
    (mean.as_vec3().to_array(), extent as f32)
}

/// The last part of a path, made absolute if need be, for use as a scene's name.
pub(crate) fn folder_name(root: &Path) -> String {
    let absolute = root.canonicalize().unwrap_or_else(|_| root.to_path_buf());
    absolute.file_name().map_or_else(|| "scene".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions() {
        assert_eq!(Resolution::Native.apply((800, 600)), (800, 600));
        assert_eq!(Resolution::MaxSide(200).apply((800, 600)), (200, 150));
        assert_eq!(Resolution::MaxSide(200).apply((600, 800)), (150, 200));
        assert_eq!(Resolution::MaxSide(900).apply((800, 600)), (800, 600));
        assert_eq!(Resolution::MaxSide(1).apply((800, 6)), (1, 1));
        let exact = Resolution::Exact { width: 200, height: 200 };
        assert_eq!(exact.apply((800, 600)), (200, 200));
    }

    #[test]
    fn names_parse_back() {
        for split in Split::ALL {
            assert_eq!(split.to_string().parse::<Split>().unwrap(), split);
        }
        assert_eq!("dnerf".parse::<Format>().unwrap(), Format::DNerf);
        assert!("blurays".parse::<Format>().unwrap_err().to_string().contains("dnerf"));
    }

    #[test]
    fn folders_without_a_dataset_and_bad_options_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let open = |options: &LoadOptions| Scene::open(folder.path(), options).unwrap_err();
        let unknown = open(&LoadOptions::default());
        assert!(unknown.to_string().contains("transforms_train.json"), "{unknown}");
        let missing = Scene::open(&folder.path().join("no"), &LoadOptions::default());
        assert!(matches!(missing, Err(DataError::Io { .. })));
        let bad = [
            LoadOptions { background: [0.0, f32::NAN, 0.0], ..Default::default() },
            LoadOptions { resolution: Resolution::MaxSide(0), ..Default::default() },
            LoadOptions { random_points: 0, ..Default::default() },
            LoadOptions { random_half_size: -1.0, ..Default::default() },
        ];
        for options in bad {
            assert!(matches!(open(&options), DataError::Options { .. }));
        }
    }
}
