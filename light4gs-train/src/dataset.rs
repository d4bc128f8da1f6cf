//! Where a run's frames and images come from.

use std::collections::HashMap;
use std::sync::Arc;

use light4gs_codec::{SceneMeta, legal_name};
use light4gs_data::{
    DataError, Frame, ImageStore, LoadOptions, PixelMask, Region, Resolution, RgbImage8, Scene, regions,
};

use crate::config::Config;

/// Gives the images of frames. Several threads call it at the same time.
pub trait ImageSource: Send + Sync {
    /// The image of a frame, of the size of the frame's camera.
    ///
    /// # Errors
    /// If the frame has no image, or it cannot be read.
    fn image(&self, frame: &Frame) -> Result<Arc<RgbImage8>, DataError>;

    /// The pixels of the frame's image that may be trained on; `None` means all of them.
    ///
    /// # Errors
    /// If the mask cannot be read.
    fn trained_pixels(&self, frame: &Frame) -> Result<Option<Arc<PixelMask>>, DataError> {
        let _ = frame;
        Ok(None)
    }

    /// The regions of the image over which metrics are taken; none if the frame has no mask.
    ///
    /// # Errors
    /// If the mask cannot be read.
    fn regions(&self, frame: &Frame) -> Result<Vec<(Region, PixelMask)>, DataError> {
        let _ = frame;
        Ok(Vec::new())
    }

    /// Announces frames that will be needed, so that a source can begin to read them.
    fn prefetch(&self, frames: &[Frame]) {
        let _ = frames;
    }
}

impl ImageSource for ImageStore {
    fn image(&self, frame: &Frame) -> Result<Arc<RgbImage8>, DataError> {
        self.get(frame)
    }

    fn trained_pixels(&self, frame: &Frame) -> Result<Option<Arc<PixelMask>>, DataError> {
        Ok(self.get_masked(frame)?.1)
    }

    fn regions(&self, frame: &Frame) -> Result<Vec<(Region, PixelMask)>, DataError> {
        regions(frame)
    }

    fn prefetch(&self, frames: &[Frame]) {
        ImageStore::prefetch(self, frames);
    }
}

/// Images in memory, by the names of their frames.
#[derive(Clone, Debug, Default)]
pub struct MemoryImages(HashMap<String, Arc<RgbImage8>>);

impl FromIterator<(String, RgbImage8)> for MemoryImages {
    fn from_iter<I: IntoIterator<Item = (String, RgbImage8)>>(images: I) -> Self {
        Self(images.into_iter().map(|(name, image)| (name, Arc::new(image))).collect())
    }
}

impl ImageSource for MemoryImages {
    fn image(&self, frame: &Frame) -> Result<Arc<RgbImage8>, DataError> {
        self.0.get(&frame.name).cloned().ok_or_else(|| DataError::Image {
            path: frame.name.clone().into(),
            problem: "no image of this name is in memory".into(),
            remedy: "give one for every frame that is trained on".into(),
        })
    }
}

/// The slowest rate of frames that counts as one, a second.
const SLOWEST: f64 = 1e-3;

/// The options with which a dataset is opened for a configuration.
pub fn load_options(config: &Config) -> LoadOptions {
    let other = LoadOptions::default();
    LoadOptions {
        layout: config.data.layout.clone(),
        frames: config.data.frames,
        resolution: config.data.resolution.map_or(Resolution::Native, Resolution::MaxSide),
        background: config.data.background,
        seed: config.seed,
        random_points: config.data.initial_points,
        random_half_size: config.data.initial_box,
        // A cloud that is larger than what training may grow to would only be pruned again.
        most_points: config.train.densify.chosen().max_gaussians().unwrap_or(other.most_points),
        times: config.data.times.into(),
        cameras: config.data.cameras.into(),
        synchronize: config.data.synchronize,
        frames_a_second: Some(config.data.frames_a_second).filter(|rate| *rate >= SLOWEST),
        between: Some(config.data.between).filter(|window| *window != [0.0, 1.0]),
        most_times: config.data.most_times,
    }
}

/// A store of images from disk, with the memory limit of a configuration.
pub fn image_store(config: &Config) -> ImageStore {
    ImageStore::new(&load_options(config), (config.data.memory_limit_mib << 20) as usize)
}

/// Bytes of images that are kept where each is looked at once.
const PASSING_BYTES: usize = 16 << 20;

/// The images of a dataset that are looked at once, in their order: of a take of any length, few are in memory.
pub fn passing_images(config: &Config) -> ImageStore {
    ImageStore::new(&load_options(config), PASSING_BYTES)
}

/// The metadata for the file of a scene.
pub fn scene_meta(config: &Config, data: &Scene) -> SceneMeta {
    let positions = &data.points.positions;
    let bound = |pick: fn(f32, f32) -> f32, start: f32| {
        std::array::from_fn(|axis| positions.iter().map(|p| p[axis]).fold(start, pick))
    };
    let bounds =
        if positions.is_empty() { [[0.0; 3]; 2] } else { [bound(f32::min, f32::MAX), bound(f32::max, f32::MIN)] };
    let camera = data.train[0].camera;
    let mut times: Vec<f32> = data.train.iter().map(|frame| frame.time).collect();
    times.sort_by(f32::total_cmp);
    times.dedup();
    SceneMeta {
        // A folder may have any name.
        name: legal_name(&data.name),
        frame_count: times.len() as u32,
        fps: data
            .seconds
            .filter(|_| times.len() > 1)
            .map_or(0.0, |seconds| ((times.len() - 1) as f64 / seconds) as f32),
        bounds,
        background: data.background,
        config_digest: config.digest(),
        width: camera.width,
        height: camera.height,
        fov_x: camera.fov().0,
        ..SceneMeta::default()
    }
}
