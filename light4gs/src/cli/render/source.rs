//! What is drawn: a clip, on any back end, or a take, on the processor.

use std::path::Path;

use light4gs_codec::{Limits, SceneMeta};
use light4gs_data::{Frame, RgbImage8};
use light4gs_render::PlayableTake;
use light4gs_train::config::DeviceName;
use light4gs_train::device;
use light4gs_train::error::TrainError;
use light4gs_train::evaluation::DecodedScene;
use light4gs_train::take::render_take;

use crate::cli::take::is_take_file;

pub(super) enum Source {
    Clip(Box<DecodedScene>),
    Take(Box<PlayableTake>),
}

impl Source {
    /// # Errors
    /// A file that cannot be read; a graphics card for a take.
    pub(super) fn open(file: &Path, limits: &Limits, device: DeviceName) -> Result<Self, TrainError> {
        if !is_take_file(file) {
            let scene = DecodedScene::open_with_limits(file, limits, &device::open(device)?)?;
            return Ok(Self::Clip(Box::new(scene)));
        }
        if let DeviceName::Wgpu(_) = device {
            return Err(TrainError::Input(format!(
                "--device {device}: {} is a take, and takes are drawn on the processor; leave out --device",
                file.display()
            )));
        }
        Ok(Self::Take(Box::new(PlayableTake::open(file, limits)?)))
    }

    /// Size of the images, field of view and background; those of a take are its base's.
    pub(super) fn meta(&self) -> &SceneMeta {
        match self {
            Self::Clip(scene) => &scene.data.meta,
            Self::Take(take) => &take.base().info().meta,
        }
    }

    /// An image from a camera at its time, a share of the whole.
    ///
    /// # Errors
    /// A damaged segment.
    pub(super) fn render(&self, frame: &Frame) -> Result<RgbImage8, TrainError> {
        match self {
            Self::Clip(scene) => Ok(scene.render(frame).to_u8()),
            Self::Take(take) => render_take(take, frame, self.meta().background),
        }
    }
}
