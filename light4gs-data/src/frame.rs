//! One posed image of a scene.

use crate::camera::Camera;
use crate::lens::Lens;
use std::path::PathBuf;

/// A file that marks the pixels of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// An image of the frame's size, or of another; its pixels are 0 or not.
    pub path: PathBuf,
    /// What 0 means in it.
    pub zero: MaskMeaning,
}

/// What a mask's zero pixels mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskMeaning {
    /// They are neither trained on nor measured.
    Ignored,
    /// Something moves there, and nothing elsewhere.
    Moving,
    /// Nothing moves there, and something does elsewhere.
    Still,
}

/// A camera, a time, and the path of the image. The image itself is read by [`crate::ImageStore`].
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// A name without folder and extension, such as `r_003`. [`crate::Scene::new`] makes it unique in its split.
    pub name: String,
    /// The camera, at the size at which images are used: after resizing, and without distortion.
    pub camera: Camera,
    /// Time in `[0, 1]`.
    pub time: f32,
    /// The image's file; empty for a frame without an image (a video path).
    pub path: PathBuf,
    /// Width of the image in its file (after any rotation that the file asks for), pixels; 0 without an image.
    pub source_width: u32,
    /// Height of the image in its file, pixels; 0 without an image.
    pub source_height: u32,
    /// Number of the capture's camera that took it; 0 where there is only one.
    pub camera_id: u32,
    /// A file that marks pixels.
    pub mask: Option<Mask>,
    /// The lens with which the image was taken. The image store undistorts images.
    pub lens: Option<Lens>,
}

impl Frame {
    /// A frame with an image of `source` = (width, height) pixels in the file `path`, taken by camera 0 through a
    /// pinhole, without a mask.
    pub fn new(name: impl Into<String>, camera: Camera, time: f32, path: PathBuf, source: (u32, u32)) -> Self {
        Self { path, source_width: source.0, source_height: source.1, ..Self::without_image(name, camera, time) }
    }

    /// A frame that is only ever rendered: no image belongs to it.
    pub fn without_image(name: impl Into<String>, camera: Camera, time: f32) -> Self {
        Self {
            name: name.into(),
            camera,
            time,
            path: PathBuf::new(),
            source_width: 0,
            source_height: 0,
            camera_id: 0,
            mask: None,
            lens: None,
        }
    }

    /// Whether an image belongs to this frame.
    pub fn has_image(&self) -> bool {
        !self.path.as_os_str().is_empty()
    }
}
