//! The digest of a dataset, which a run keeps, and the changes since it was taken, as text.

mod changes;
mod content;

use crate::error::DataError;
use crate::frame::Frame;
use crate::scene::{Scene, Split};
pub(crate) use content::Content;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// The state of a dataset when it was opened: frames in their order, poses, intrinsics, times, the content of image
/// files, and the points.
///
/// Of a file larger than 32 KiB only its length and eight blocks of 4 KiB, spread evenly, are read, so 6000 images take
/// about a second. This is enough to notice an image that was replaced or edited, since compressed files then differ
/// almost everywhere. Dates of files are ignored, and so are the dataset's path and the size at which images are used.
///
/// ```
/// use light4gs_data::{DatasetDigest, LoadOptions, Scene, SyntheticOptions, write_synthetic};
///
/// # let folder = tempfile::tempdir().unwrap();
/// let root = folder.path().join("scene");
/// write_synthetic(&root, &SyntheticOptions { resolution: 16, train_frames: 3, ..Default::default() })?;
/// let before = DatasetDigest::of(&Scene::open(&root, &LoadOptions::default())?)?;
/// std::fs::copy(root.join("test/r_000.png"), root.join("train/r_001.png")).unwrap();
/// let after = DatasetDigest::of(&Scene::open(&root, &LoadOptions::default())?)?;
/// assert_eq!(after.changes_since(&before), ["train: the image of 1 frame was replaced: train/r_001.png"]);
/// # Ok::<(), light4gs_data::DataError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetDigest {
    /// Name of the layout.
    layout: String,
    /// Training, test and validation frames in their order.
    frames: Vec<FrameDigest>,
    /// SHA-256 of positions and colors of the points, hexadecimal.
    points: String,
}

/// The state of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct FrameDigest {
    split: String,
    /// Path relative to the dataset; for a file outside of it, its name.
    file: String,
    /// Pixels of the image file.
    size: [u32; 2],
    content: Content,
    mask: Option<Content>,
    time: f32,
    /// Rotation and translation, world to camera.
    pose: [f32; 12],
    /// Focal lengths and principal point as shares of width and height.
    intrinsics: [f32; 4],
    /// The lens as text; empty for a pinhole.
    lens: String,
}

impl DatasetDigest {
    /// The digest of an opened scene. It reads a part of every image file, see above.
    ///
    /// # Errors
    /// [`DataError::Io`] naming the file that cannot be read.
    pub fn of(scene: &Scene) -> Result<Self, DataError> {
        let splits = [Split::Train, Split::Test, Split::Val];
        let frames: Vec<(Split, &Frame)> =
            splits.iter().flat_map(|split| scene.frames(*split).iter().map(|frame| (*split, frame))).collect();
        let digests: Vec<Result<FrameDigest, DataError>> =
            frames.par_iter().map(|(split, frame)| FrameDigest::of(*split, frame, &scene.root)).collect();
        let mut hash = Sha256::new();
        for value in scene.points.positions.iter().chain(&scene.points.colors).flatten() {
            hash.update(value.to_le_bytes());
        }
        Ok(Self {
            layout: scene.layout.to_owned(),
            frames: digests.into_iter().collect::<Result<_, _>>()?,
            points: content::hexadecimal(&hash.finalize()),
        })
    }

    /// The changes since an earlier digest, in sentences for people; empty if there are none.
    pub fn changes_since(&self, earlier: &Self) -> Vec<String> {
        changes::between(earlier, self)
    }
}

impl FrameDigest {
    fn of(split: Split, frame: &Frame, root: &Path) -> Result<Self, DataError> {
        let camera = &frame.camera;
        let (width, height) = (camera.width.max(1) as f32, camera.height.max(1) as f32);
        let mut pose = [0.0; 12];
        pose[..9].copy_from_slice(&camera.rotation.to_cols_array());
        pose[9..].copy_from_slice(&camera.translation.to_array());
        Ok(Self {
            split: split.name().to_owned(),
            file: relative(root, &frame.path),
            size: [frame.source_width, frame.source_height],
            content: Content::of(&frame.path)?,
            mask: frame.mask.as_ref().map(|mask| Content::of(&mask.path)).transpose()?,
            time: frame.time,
            pose,
            intrinsics: [camera.fx / width, camera.fy / height, camera.cx / width, camera.cy / height],
            lens: frame.lens.map_or_else(String::new, |lens| format!("{lens:?}")),
        })
    }
}

fn relative(root: &Path, path: &Path) -> String {
    let below = path.strip_prefix(root).ok();
    let named = below.or_else(|| path.file_name().map(Path::new)).unwrap_or(path);
    named.to_string_lossy().into_owned()
}
