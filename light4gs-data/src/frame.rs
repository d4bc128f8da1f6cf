//! One posed image of a scene.

use crate::camera::Camera;
use std::path::PathBuf;

/// A camera, a time, and where the image lies. The image itself is read by [`crate::ImageStore`].
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name without folder and extension, such as `r_003`.
    pub name: String,
    /// The camera, at the size at which images are used (after any resizing).
    pub camera: Camera,
    /// Time in `[0, 1]`.
    pub time: f32,
    /// The image's file; empty for a frame without an image (a video path).
    pub path: PathBuf,
    /// Width of the image in its file, pixels; 0 without an image.
    pub source_width: u32,
    /// Height of the image in its file, pixels; 0 without an image.
    pub source_height: u32,
}

impl Frame {
    /// A frame that is only ever rendered: no image belongs to it.
    pub fn without_image(name: impl Into<String>, camera: Camera, time: f32) -> Self {
        Self { name: name.into(), camera, time, path: PathBuf::new(), source_width: 0, source_height: 0 }
    }

    /// Whether an image belongs to this frame.
    pub fn has_image(&self) -> bool {
        !self.path.as_os_str().is_empty()
    }
}
