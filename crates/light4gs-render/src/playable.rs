//! A decoded file: the scene can be computed and drawn at any time.

use light4gs_codec::{
    CodecError, Decoded, FurtherAttribute, GaussianArrays, Limits, MotionEvaluator, MotionSource, OpenStream,
    SceneData, StreamInfo,
};
use light4gs_data::Camera;

use crate::drawing::{Allowance, check_memory};

/// A decoded file: the scene can be computed and drawn at any time.
///
/// All methods take `&self`, and several threads may call them at once.
///
/// ```no_run
/// use light4gs_codec::Limits;
/// use light4gs_data::Camera;
/// use light4gs_render::PlayableScene;
///
/// let scene = PlayableScene::open("scene.l4gs".as_ref(), &Limits::default())?;
/// let camera = Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, 400, 300);
/// let image = scene.render(&camera, 0.5, scene.info().meta.background)?;
/// assert_eq!(image.len(), 300 * 400 * 3);
/// # Ok::<(), light4gs_codec::CodecError>(())
/// ```
#[derive(Debug)]
pub struct PlayableScene {
    canonical: GaussianArrays,
    info: StreamInfo,
    evaluator: MotionEvaluator,
    allowance: Allowance,
}

impl PlayableScene {
    /// Decodes a stream.
    ///
    /// # Errors
    /// As [`light4gs_codec::decode`]; an attribute that neither this crate nor the file explains; a motion that takes
    /// more than eight times the memory of `limits`.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, CodecError> {
        let Decoded { scene, info, .. } = OpenStream::with_limits(bytes, limits)?.decode()?;
        let allowance = Allowance::of_stream(limits, bytes.len());
        check_memory("memory of the motion", motion_bytes(&scene), allowance.memory_bytes)?;
        let evaluator = MotionEvaluator::new(&scene)?;
        Ok(Self { canonical: scene.gaussians, info, evaluator, allowance })
    }

    /// Decodes a file. Not in a browser, which has none.
    ///
    /// # Errors
    /// As [`PlayableScene::decode`], and a file that the system cannot read; the message names the file.
    #[cfg(not(target_os = "unknown"))]
    pub fn open(path: &std::path::Path, limits: &Limits) -> Result<Self, CodecError> {
        light4gs_codec::read_file_and(path, limits, |bytes| Self::decode(bytes, limits))
    }

    /// What the file holds: metadata, counts, sections.
    pub fn info(&self) -> &StreamInfo {
        &self.info
    }

    /// The attributes of the Gaussians beyond those that every file has. They do not change with time.
    pub fn further(&self) -> &[FurtherAttribute] {
        &self.canonical.further
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.canonical.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.canonical.is_empty()
    }

    /// The Gaussians at a time in [0, 1], before their activations; to the bit the same on every machine. Takes one thread.
    ///
    /// # Errors
    /// Another time.
    pub fn at(&self, time: f32) -> Result<GaussianArrays, CodecError> {
        if !(0.0..=1.0).contains(&time) {
            return Err(CodecError::Invalid {
                section: "rendering",
                field: "time".into(),
                found: time.to_string(),
                expected: "a number from 0 (first frame) to 1 (last)".into(),
            });
        }
        let mut moved = self.canonical.clone();
        self.evaluator.apply(&self.canonical, time, 0..self.canonical.len(), &mut moved);
        Ok(moved)
    }

    /// An image `[height, width, 3]` of the scene at a time in [0, 1]: red, green, blue over the background, 0 or more and not
    /// clamped above. Takes the threads of rayon's current pool; the numbers do not depend on how many there are.
    ///
    /// # Errors
    /// Another time; an image beyond [`Limits::image_side`] or [`Limits::image_pixels`]; an image that takes more than eight
    /// times [`Limits::memory_bytes`], because too many Gaussians cover too much of it.
    pub fn render(&self, camera: &Camera, time: f32, background: [f32; 3]) -> Result<Vec<f32>, CodecError> {
        self.allowance.image(camera, background, (self.len(), self.numbers()), || self.at(time))
    }

    /// Numbers of all Gaussians together.
    pub(crate) fn numbers(&self) -> usize {
        self.canonical.attributes().map(|attribute| attribute.values.len()).sum()
    }

    /// The Gaussians as they are stored, for a scene in which nothing moves.
    pub(crate) fn canonical(&self) -> &GaussianArrays {
        &self.canonical
    }

    /// What showing it may take.
    pub(crate) fn allowance(&self) -> Allowance {
        self.allowance
    }
}

/// Bytes of a [`MotionEvaluator`] for all Gaussians together. (For the planes it takes less than the scene.)
fn motion_bytes(scene: &SceneData) -> u64 {
    let reads_features =
        scene.motion.network.as_ref().is_some_and(|motion| motion.sources.contains(&MotionSource::Features));
    let features = if reads_features { scene.feature_planes.features() } else { 0 };
    (scene.gaussians.len() as u64).saturating_mul(features.saturating_mul(4).saturating_add(12))
}

#[cfg(test)]
mod tests {
    use light4gs_codec::encode;

    use super::*;

    /// `count` large Gaussians in the middle of the view.
    fn scene(count: usize) -> Vec<u8> {
        let gaussians = GaussianArrays {
            means: vec![[0.0; 3]; count],
            log_scales: vec![[1.0; 3]; count],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: vec![0.0; count],
            sh_dc: vec![[1.0, 0.0, -1.0]; count],
            sh_degree: 0,
            sh_rest: Vec::new(),
            further: Vec::new(),
        };
        encode(&SceneData { gaussians, ..SceneData::default() }).expect("a stream")
    }

    fn camera(width: u32, height: u32) -> Camera {
        Camera::look_at([0.0, -4.0, 0.0].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, width, height)
    }

    #[test]
    fn the_middle_has_the_color_of_the_gaussian() {
        let scene = PlayableScene::decode(&scene(1), &Limits::default()).expect("a scene");
        let image = scene.render(&camera(33, 21), 0.5, [0.0, 1.0, 0.0]).expect("an image");
        assert_eq!(image.len(), 33 * 21 * 3);
        let middle = &image[3 * (10 * 33 + 16)..][..3];
        let expected = [0.5 * (0.5 + 0.282_094_8), 0.5 * 0.5 + 0.5, 0.5 * (0.5 - 0.282_094_8)];
        assert!(middle.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-3), "{middle:?}");
    }

    #[test]
    fn wrong_times_and_sizes_are_refused() {
        let scene = PlayableScene::decode(&scene(1), &Limits::default()).expect("a scene");
        for time in [-0.1, 1.1, f32::NAN, f32::INFINITY] {
            assert!(scene.at(time).is_err() && scene.render(&camera(4, 4), time, [0.0; 3]).is_err(), "{time}");
        }
        for (width, height) in [(16_385, 1), (1, 16_385), (16_384, 16_384)] {
            assert!(scene.render(&camera(width, height), 0.0, [0.0; 3]).is_err(), "{width} × {height}");
        }
        assert!(scene.render(&camera(0, 5), 0.0, [0.0; 3]).expect("no pixels").is_empty());
    }

    #[test]
    fn memory_is_counted_before_it_is_taken() {
        let limits = Limits { memory_bytes: 32 << 20, ..Limits::default() };
        let scene = PlayableScene::decode(&scene(3000), &limits).expect("a scene");
        assert!(scene.render(&camera(64, 64), 0.0, [0.0; 3]).is_ok());
        let error = scene.render(&camera(1200, 1200), 0.0, [0.0; 3]).expect_err("5625 tiles of 3000 Gaussians");
        assert!(error.to_string().contains("memory of the image"), "{error}");
    }

    #[test]
    fn an_empty_scene_is_its_background() {
        let scene = PlayableScene::decode(&scene(0), &Limits::default()).expect("a scene");
        assert_eq!(scene.render(&camera(1, 1), 1.0, [0.1, 0.2, 0.3]).expect("an image"), [0.1, 0.2, 0.3]);
    }
}
