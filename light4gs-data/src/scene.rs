//! A scene: posed frames in splits, a point cloud, an extent.

use crate::error::DataError;
use crate::frame::Frame;
use crate::points::PointCloud;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A part of a scene's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Split {
    /// Frames to learn from.
    Train,
    /// Frames to measure quality on; never trained on.
    Test,
    /// More frames to measure quality on; may be empty.
    Val,
    /// A camera path without images.
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

/// The frames of a scene by split, as a [`crate::DatasetLayout`] reads them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplitFrames {
    /// Frames to learn from; at least one.
    pub train: Vec<Frame>,
    /// Frames to measure quality on; at least one.
    pub test: Vec<Frame>,
    /// More frames to measure quality on; may be empty.
    pub val: Vec<Frame>,
    /// A camera path without images; may be empty.
    pub video: Vec<Frame>,
}

/// A dataset: camera and time of every image, the points at which the Gaussians start, and the extent.
///
/// Images stay on disk; [`crate::ImageStore`] reads them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The folder's name.
    pub name: String,
    /// The folder.
    pub root: PathBuf,
    /// Name of its layout, see [`crate::DatasetLayout::name`].
    pub layout: &'static str,
    /// Frames to learn from; at least one.
    pub train: Vec<Frame>,
    /// Frames to measure quality on; at least one, but for a window of a scene ([`Scene::between`]).
    pub test: Vec<Frame>,
    /// More frames to measure quality on; may be empty.
    pub val: Vec<Frame>,
    /// A camera path without images.
    pub video: Vec<Frame>,
    /// The color behind transparent pixels: red, green, blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Where the Gaussians start.
    pub points: PointCloud,
    /// Mean of the training cameras' centers, world units.
    pub camera_mean: [f32; 3],
    /// 1.1 times the largest distance of a training camera's center from their mean, world units
    /// (1 if they all coincide, since learning rates are multiplied by it).
    pub extent: f32,
    /// Seconds from time 0 to time 1, where the capture or [`LoadOptions::frames_a_second`](crate::LoadOptions) says so.
    pub seconds: Option<f64>,
    /// Notes for the user about reading the folder, such as images without a pose, or frames that were left out.
    pub notes: Vec<String>,
    /// How cameras and times were read.
    pub reading: Reading,
}

/// In words: where cameras and times of a scene come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// Such as `one moving camera`. Empty: as the layout has them.
    pub cameras: String,
    /// Such as `the last number in the images' names`. Empty: as the layout has them.
    pub times: String,
    /// Images beside those that are used, without a pose.
    pub unposed: usize,
}

/// Far more than any capture has: 20 cameras for half an hour.
const MAX_FRAMES: usize = 1_000_000;

/// A cloud with fewer points than this says little about where the scene is.
const FEW_POINTS: usize = 10;

impl Scene {
    /// A scene from frames and points that a [`crate::DatasetLayout`] has read in the folder `root`.
    ///
    /// The name is that of the folder; `camera_mean` and `extent` follow from the training cameras. Frames of a split
    /// whose names are equal, or differ only in case, are renamed: the folder of the image is put before the name, or a
    /// number after it. So files that are named after frames do not overwrite each other.
    ///
    /// # Errors
    /// [`DataError::Field`] when there is no training or no test frame, or no point to start from.
    pub fn new(
        layout: &'static str,
        root: &Path,
        frames: SplitFrames,
        points: PointCloud,
        background: [f32; 3],
    ) -> Result<Self, DataError> {
        if frames.train.len() + frames.test.len() == 1 {
            let problem = "1 image found, expected at least 2: one to learn from and one to measure";
            return Err(DataError::field(root, "images", problem, "add images from other places or times"));
        }
        let counts = [("train", frames.train.len()), ("test", frames.test.len()), ("points", points.len())];
        if let Some((what, _)) = counts.into_iter().find(|(_, count)| *count == 0) {
            return Err(DataError::field(root, what, "0 found, expected at least one", "complete the dataset"));
        }
        let SplitFrames { mut train, mut test, mut val, mut video } = frames;
        let count = train.len() + test.len() + val.len() + video.len();
        if count > MAX_FRAMES {
            let problem = format!("{count} found, expected at most {MAX_FRAMES}");
            return Err(DataError::field(root, "frames", problem, "take every n-th frame"));
        }
        for split in [&mut train, &mut test, &mut val, &mut video] {
            make_names_unique(split);
        }
        let (camera_mean, extent) = mean_and_extent(&train);
        let (name, root) = (folder_name(root), root.to_path_buf());
        Ok(Self {
            name,
            root,
            layout,
            train,
            test,
            val,
            video,
            background,
            points,
            camera_mean,
            extent,
            seconds: None,
            notes: Vec::new(),
            reading: Reading::default(),
        })
    }

    /// The same scene with notes of its reader, before those that it has.
    #[must_use]
    pub fn with_notes(mut self, notes: Vec<String>) -> Self {
        self.notes.splice(0..0, notes);
        self
    }

    /// The same scene, with the sources of its cameras and times.
    #[must_use]
    pub fn with_reading(mut self, reading: Reading) -> Self {
        self.reading = reading;
        self
    }

    /// The same scene, with the seconds from its time 0 to its time 1.
    #[must_use]
    pub fn with_seconds(mut self, seconds: Option<f64>) -> Self {
        self.seconds = seconds;
        self
    }

    /// The same scene without points that cannot be meant, and with at most `most` points, with a note about those that
    /// are left out. Points alone in a scene are left as they are.
    pub(crate) fn with_usable_points(mut self, most: usize) -> Self {
        let far = self.points.leave_out_far(&self.train);
        if far > 0 {
            self.notes.push(format!(
                "{far} of the {} points lie more than 100 times as far away as the others and the cameras, and are left out",
                far + self.points.len()
            ));
        }
        let given = self.points.len();
        if self.points.thin(most) > 0 {
            self.notes.push(format!("of the {given} points, {} are kept, evenly chosen", self.points.len()));
        }
        if self.points.len() < FEW_POINTS {
            let count = self.points.len();
            self.notes
                .push(format!("training starts from {count} points only; without a cloud it starts from random ones"));
        }
        self
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

/// Mean of the cameras' centers, and 1.1 times the largest distance from it (1 if that is 0).
fn mean_and_extent(frames: &[Frame]) -> ([f32; 3], f32) {
    let centers: Vec<glam::DVec3> = frames.iter().map(|frame| frame.camera.center().as_dvec3()).collect();
    let mean = centers.iter().sum::<glam::DVec3>() / centers.len().max(1) as f64;
    let radius = centers.iter().fold(0.0f64, |largest, center| largest.max((*center - mean).length()));
    let extent = if radius > 0.0 { 1.1 * radius } else { 1.0 };
    (mean.as_vec3().to_array(), extent as f32)
}

/// Renames frames of equal names, see [`Scene::new`]. Unique names stay as they are.
fn make_names_unique(frames: &mut [Frame]) {
    let folded = |name: &str| name.to_lowercase();
    let mut uses: HashMap<String, usize> = HashMap::new();
    for frame in frames.iter() {
        *uses.entry(folded(&frame.name)).or_default() += 1;
    }
    let mut taken: HashSet<String> =
        uses.iter().filter(|(_, count)| **count == 1).map(|(name, _)| name.clone()).collect();
    // Up to which number each name is taken, so that a thousand frames of one image do not count to a thousand each.
    let mut numbers: HashMap<String, usize> = HashMap::new();
    for frame in frames.iter_mut().filter(|frame| uses[&folded(&frame.name)] > 1) {
        let folder = frame.path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let base = folder.map_or_else(|| frame.name.clone(), |folder| format!("{folder}_{}", frame.name));
        let number = numbers.entry(folded(&base)).or_insert(1);
        frame.name = base.clone();
        while !taken.insert(folded(&frame.name)) {
            *number += 1;
            frame.name = format!("{base}_{number}");
        }
    }
}

/// The last part of a path, made absolute if need be, for use as a scene's name.
fn folder_name(root: &Path) -> String {
    let absolute = root.canonicalize().unwrap_or_else(|_| root.to_path_buf());
    absolute.file_name().map_or_else(|| "scene".into(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use glam::Vec3;

    #[test]
    fn names_parse_back() {
        for split in Split::ALL {
            assert_eq!(split.to_string().parse::<Split>().unwrap(), split);
        }
        assert!("training".parse::<Split>().unwrap_err().to_string().contains("expected train"));
    }

    #[test]
    fn frames_of_one_name_get_others() {
        let frame = |name: &str, path: &str| {
            let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 8, 8);
            Frame::new(name, camera, 0.0, path.into(), (8, 8))
        };
        let mut frames = [
            frame("0001", "a/cam00/0001.png"),
            frame("0001", "a/cam01/0001.png"),
            frame("x", "b/x.png"),
            frame("X", "b/X.png"),
            frame("cam00_0001", "c/cam00_0001.png"),
            frame("only", "b/only.png"),
        ];
        make_names_unique(&mut frames);
        let names = frames.map(|frame| frame.name);
        assert_eq!(names, ["cam00_0001_2", "cam01_0001", "b_x", "b_X_2", "cam00_0001", "only"]);
    }

    #[test]
    fn extent_follows_from_the_cameras_and_empty_splits_are_refused() {
        let frame = |x: f32| {
            let camera = Camera::look_at(Vec3::new(x, 0.0, 0.0), Vec3::Y, Vec3::Z, 0.7, 8, 8);
            Frame::without_image(format!("{x}"), camera, 0.0)
        };
        let (train, test) = (vec![frame(1.0), frame(3.0)], vec![frame(9.0), frame(8.0)]);
        let frames = SplitFrames { train, test, ..Default::default() };
        let points = PointCloud::random(3, 1.0, 0);
        let new = |frames, points| Scene::new("mine", Path::new("a/b"), frames, points, [1.0; 3]);
        let scene = new(frames.clone(), points.clone()).unwrap();
        assert_eq!((scene.name.as_str(), scene.layout), ("b", "mine"));
        let mean = Vec3::from(scene.camera_mean);
        assert!(mean.distance(Vec3::new(2.0, 0.0, 0.0)) < 1e-6, "{mean}");
        assert!((scene.extent - 1.1).abs() < 1e-6);
        let without = |split: &str| {
            let (mut frames, mut points) = (frames.clone(), points.clone());
            match split {
                "train" => frames.train.clear(),
                "test" => frames.test.clear(),
                _ => points = PointCloud::default(),
            }
            new(frames, points).unwrap_err().to_string()
        };
        for split in ["train", "test", "points"] {
            assert!(without(split).contains(split));
        }
    }
}
