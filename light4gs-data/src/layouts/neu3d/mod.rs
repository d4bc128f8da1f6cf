//! The layout of Neural 3D Video (Neu3D, DyNeRF): a rig of synchronized cameras that do not move.
//!
//! `poses_bounds.npy` has a row for each camera, in LLFF's axes. `camXX/images` (or `camXX` itself) holds the frames of
//! a camera, or `camXX.mp4` its video, from which they are extracted. As in the 4DGS reference, poses are neither
//! centered nor scaled, the first camera is held out, and the time of frame `i` is `i` divided by the length of the
//! sequence. Frames of videos with different or varying rates have the times at which they are shown. Where frames are not taken
//! from videos, they are 30 a second, the rate of the dataset.

mod cameras;
mod frames;
mod spiral;
mod taking;
#[cfg(test)]
mod tests;

use super::layout::DatasetLayout;
use super::shared::npy::{self, Array2};
use super::shared::posed::{self, PosedImage};
use crate::camera::{Camera, Intrinsics};
use crate::error::DataError;
use crate::frame::Frame;
use crate::options::LoadOptions;
use crate::points::PointCloud;
use crate::scene::{Scene, SplitFrames};
use cameras::CameraFrames;
use frames::{Rig, RigFrame};
use glam::{DMat3, DVec3};
use std::path::Path;

/// Frames per second of the dataset, as its authors say. Frames in folders do not say it.
const RATE: f64 = 30.0;
/// Numbers of a row: a pose of 3 × 5, and the nearest and farthest depth.
const COLUMNS: usize = 17;

/// The layout `neu3d`: a static rig, `poses_bounds.npy` and a folder or a video a camera.
#[derive(Clone, Copy, Debug, Default)]
pub struct Neu3d;

impl DatasetLayout for Neu3d {
    fn name(&self) -> &'static str {
        "neu3d"
    }

    fn signature(&self) -> &'static str {
        "poses_bounds.npy"
    }

    fn detect(&self, root: &Path) -> bool {
        root.join(self.signature()).is_file()
    }

    fn open(&self, root: &Path, options: &LoadOptions) -> Result<Scene, DataError> {
        let path = root.join(self.signature());
        let table = npy::read(&path, COLUMNS, "shape (cameras, 17) as LLFF writes it")?;
        let cameras = cameras::find(root)?;
        let rows = cameras::rows(&path, &cameras, table.rows)?;
        let poses = (0..table.rows).map(|i| Pose::read(&path, &table, i)).collect::<Result<Vec<_>, _>>()?;
        let mut notes = Vec::new();
        if table.rows > cameras.len() {
            notes.push(format!(
                "poses_bounds.npy has {} rows for {} cameras: the number in a camera's name is taken for its row",
                table.rows,
                cameras.len()
            ));
        }
        let Rig { frames: found, rate } = frames::find(root, &cameras, options.frames, &mut notes)?;
        // The instant after the last one.
        let length = found.iter().flatten().map(|frame| frame.instant + 1.0).fold(1.0, f64::max);
        let wanted = options.frames.map_or(length, |wanted| wanted as f64);
        if wanted > length.ceil() {
            notes.push(format!(
                "`data.frames` says {wanted} frames, but there are {}: times end at {:.3}, as of a part of a longer capture",
                length.ceil(),
                (length - 1.0) / wanted
            ));
        }
        let images = images(&path, &poses, &cameras, &rows, found, wanted);
        let mut splits = SplitFrames::default();
        for frame in posed::frames(&images, options, &mut notes)? {
            if frame.camera_id == 0 { splits.test.push(frame) } else { splits.train.push(frame) }
        }
        if splits.train.is_empty() {
            let problem =
                format!("{} camera and {} instants found, expected at least 2 cameras", cameras.len(), length.ceil());
            return Err(DataError::field(root, "camXX", problem, "the first camera is for testing: add another"));
        }
        splits.video = video(&poses, &splits.test[0].camera);
        let points = match PointCloud::find(root)? {
            Some(points) => points,
            None => PointCloud::in_front_of(&splits.train, options),
        };
        let scene = Scene::new(self.name(), root, splits, points, options.background)?;
        Ok(scene.with_notes(notes).with_seconds(Some(wanted / rate.unwrap_or(RATE))))
    }
}

/// A row of the table.
struct Pose {
    /// Camera to world, columns right, up, back.
    rotation: DMat3,
    center: DVec3,
    intrinsics: Intrinsics,
    near: f64,
    far: f64,
}

impl Pose {
    fn read(path: &Path, table: &Array2, i: usize) -> Result<Self, DataError> {
        let row = table.row(i);
        let column = |j: usize| DVec3::new(row[j], row[5 + j], row[10 + j]);
        let [height, width, focal] = column(4).to_array();
        let positive = [("height", height), ("width", width), ("focal length", focal)];
        if let Some((what, value)) = positive.into_iter().find(|(_, value)| !(*value >= 1.0 && *value <= 1e6)) {
            return Err(DataError::field(
                path,
                format!("row {i}, column 5 of the pose"),
                format!("the {what} is {value}, expected 1 to 1000000 pixels"),
                "write height, width and focal length there, as LLFF does",
            ));
        }
        Ok(Self {
            // LLFF's columns are down, right, back.
            rotation: DMat3::from_cols(column(1), -column(0), column(2)),
            center: column(3),
            intrinsics: Intrinsics {
                width: width as u32,
                height: height as u32,
                fx: focal,
                fy: focal,
                cx: width / 2.0,
                cy: height / 2.0,
            },
            near: row[15],
            far: row[16],
        })
    }

    /// World to camera in OpenCV axes: right, down, forward.
    fn world_to_camera(&self) -> DMat3 {
        DMat3::from_cols(self.rotation.x_axis, -self.rotation.y_axis, -self.rotation.z_axis).transpose()
    }
}

/// Every frame of every camera before the end of the sequence, camera by camera.
fn images(
    path: &Path,
    poses: &[Pose],
    cameras: &[CameraFrames],
    rows: &[usize],
    frames: Vec<Vec<RigFrame>>,
    length: f64,
) -> Vec<PosedImage> {
    let mut images = Vec::new();
    for (id, ((camera, row), frames)) in cameras.iter().zip(rows).zip(frames).enumerate() {
        let pose = &poses[*row];
        for frame in frames.into_iter().filter(|frame| frame.instant < length) {
            images.push(PosedImage {
                name: format!("{}_{:04}", camera.name, frame.number),
                path: frame.path,
                mask: None,
                rotation: pose.world_to_camera(),
                center: pose.center,
                intrinsics: pose.intrinsics,
                lens: None,
                camera_id: id as u32,
                time: frame.instant / length,
                described: (path.to_path_buf(), format!("row {row}")),
            });
        }
    }
    images
}

/// The reference's spiral through the rig, with the intrinsics of one of its cameras.
fn video(poses: &[Pose], intrinsics: &Camera) -> Vec<Frame> {
    let path = spiral::spiral(
        &poses.iter().map(|pose| (pose.rotation, pose.center)).collect::<Vec<_>>(),
        poses.iter().fold(f64::INFINITY, |near, pose| near.min(pose.near)),
        poses.iter().fold(0.0, |far: f64, pose| far.max(pose.far)),
    );
    let last = path.len().saturating_sub(1).max(1) as f64;
    let camera_at = |(rotation, center): (DMat3, DVec3)| {
        let k = intrinsics;
        let size = Intrinsics {
            width: k.width,
            height: k.height,
            fx: k.fx.into(),
            fy: k.fy.into(),
            cx: k.cx.into(),
            cy: k.cy.into(),
        };
        Camera::from_pose(rotation, center, &size).ok()
    };
    let frames = path.into_iter().enumerate().filter_map(|(i, pose)| Some((i, camera_at(pose)?)));
    frames.map(|(i, camera)| Frame::without_image(format!("v_{i:03}"), camera, (i as f64 / last) as f32)).collect()
}
