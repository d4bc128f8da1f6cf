//! Gaussians with the number and the sizes of trained ones, without a training: the most that the run may have, of such a
//! size that the visible pixels are covered by [`DEPTH`] layers of disks.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor, TensorData};
use glam::Vec3;
use light4gs_data::{Frame, Scene};
use light4gs_model::GaussianTensors;

use crate::config::Config;
use crate::dataset::{ImageSource, image_store};
use crate::density::{DensityStrategy, GaussianEditor, TrainingPosition, ViewStatistics, gaussians_for_images};
use crate::error::TrainError;
use crate::stage::Stage;

/// Mean number of disks over a pixel that shows something. The disk of a Gaussian has a radius of one standard deviation.
const DEPTH: f64 = 3.0;
/// Images in which the pixels that show something are counted.
const COUNTED: usize = 4;
/// Least distance of a Gaussian from a camera as a share of the scene's extent: beside a camera it would have no size.
const NEAREST: f32 = 1e-3;

/// The density strategy of a timed moment. After the first iteration it makes the Gaussians as small as trained ones, and
/// half opaque. After the first iteration at each size of the images it adds Gaussians, up to the most that the run may
/// have at this size, and makes all of them smaller.
pub(super) struct TypicalGaussians {
    cameras: Vec<Eye>,
    /// Pixels of a whole image that show something, in the mean.
    seen: f64,
    /// The most Gaussians for whole images.
    most: usize,
    /// Iterations with each size of the images.
    interval: usize,
    /// The iteration of the fine stage after which no Gaussians are added.
    until: usize,
    /// The least distance from a camera, world units.
    nearest: f32,
}

/// A camera, as far as the sizes of Gaussians in its image depend on it.
struct Eye {
    center: Vec3,
    /// Pixels of a whole image.
    focal: f32,
}

impl TypicalGaussians {
    /// For the scene of a run. The moment has `interval` iterations with each size of the images, and adds no Gaussians
    /// after iteration `until`.
    pub(super) fn new(config: &Config, data: &Scene, interval: usize, until: usize) -> Result<Self, TrainError> {
        let most = config.train.densify.chosen().max_gaussians().unwrap_or(0);
        let eye = |Frame { camera, .. }: &Frame| Eye { center: camera.center(), focal: (camera.fx + camera.fy) / 2.0 };
        let cameras = data.train.iter().map(eye).collect();
        Ok(Self { cameras, seen: seen(config, data)?, most, interval, until, nearest: NEAREST * data.extent })
    }

    /// Standard deviations of Gaussians at these places, world units.
    fn scales(&self, places: &[Vec3]) -> Vec<f32> {
        let pixels = (DEPTH * self.seen / (std::f64::consts::PI * places.len() as f64)).sqrt() as f32;
        let scale = |place: &Vec3| {
            let magnification = |eye: &Eye| eye.focal / eye.center.distance(*place).max(self.nearest);
            pixels * self.cameras.len() as f32 / self.cameras.iter().map(magnification).sum::<f32>()
        };
        places.iter().map(scale).collect()
    }

    fn shape(&self, gaussians: &mut GaussianEditor) {
        gaussians.update(|tensors| {
            let device = tensors.means.device();
            let places: Vec<f32> = tensors.means.to_data().iter().collect();
            let places: Vec<Vec3> = places.as_chunks().0.iter().copied().map(Vec3::from_array).collect();
            let scales = TensorData::new(self.scales(&places), [places.len(), 1]);
            let log_scales = Tensor::<2>::from_data(scales, &device).log().repeat_dim(1, 3);
            let opacity_logits = tensors.opacity_logits.zeros_like();
            GaussianTensors { log_scales, opacity_logits, ..tensors }
        });
    }
}

/// Pixels of a training image that are not the background, in the mean of some images.
fn seen(config: &Config, data: &Scene) -> Result<f64, TrainError> {
    let images = image_store(config);
    let background = data.background.map(|value| (value * 255.0) as u8);
    let frames = data.train.iter().step_by(data.train.len().div_ceil(COUNTED));
    let counts = frames.map(|frame| {
        let image = images.image(frame)?;
        Ok(image.pixels.as_chunks().0.iter().filter(|pixel| **pixel != background).count() as f64)
    });
    let counts = counts.collect::<Result<Vec<_>, TrainError>>()?;
    Ok((counts.iter().sum::<f64>() / counts.len() as f64).max(1.0))
}

impl DensityStrategy for TypicalGaussians {
    fn begin_stage(&mut self, _: usize, _: &Device) {}

    fn after_backward(&mut self, _: &[ViewStatistics], _: &TrainingPosition) {}

    fn after_step(&mut self, gaussians: &mut GaussianEditor, position: &TrainingPosition) {
        let TrainingPosition { stage, iteration, image_factor, .. } = *position;
        if stage == Stage::Coarse {
            if iteration == 1 {
                self.shape(gaussians);
            }
            return;
        }
        let before = gaussians.len();
        if iteration <= self.interval || iteration > self.until || iteration % self.interval != 1 || before == 0 {
            return;
        }
        let count = gaussians_for_images(self.most, 1.0 / f64::from(image_factor)).max(before);
        let rows: Vec<usize> = (0..count).map(|row| row % before).collect();
        gaussians.select_rows(&rows, before);
        self.shape(gaussians);
    }

    fn rows_kept(&mut self, _: &[bool]) {}

    fn is_over(&self, stage: Stage, iteration: usize) -> bool {
        stage == Stage::Coarse || iteration >= self.until
    }

    fn state(&self) -> BTreeMap<String, Tensor<1>> {
        BTreeMap::new()
    }

    fn restore(&mut self, _: BTreeMap<String, Tensor<1>>, _: usize) -> Result<(), String> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use light4gs_data::PointCloud;
    use light4gs_model::GaussiansConfig;

    use super::*;
    use crate::optimization::adam::Adam;

    fn typical(eyes: &[(Vec3, f32)], seen: f64) -> TypicalGaussians {
        let cameras = eyes.iter().map(|&(center, focal)| Eye { center, focal }).collect();
        TypicalGaussians { cameras, seen, most: 10, interval: 3, until: 9, nearest: 1e-3 }
    }

    /// The disks have a few times the visible area, wherever the Gaussians are and however many there are.
    #[test]
    fn gaussians_cover_what_is_seen() {
        let seen = 5000.0;
        let typical = typical(&[(Vec3::new(0.0, 0.0, -4.0), 150.0)], seen);
        for count in [7, 400] {
            let places: Vec<Vec3> = (0..count).map(|i| Vec3::new(0.1, 0.2, i as f32 * 0.01)).collect();
            let area = |(place, scale): (&Vec3, f32)| {
                let pixels = f64::from(scale * 150.0 / place.distance(Vec3::new(0.0, 0.0, -4.0)));
                std::f64::consts::PI * pixels * pixels
            };
            let covered: f64 = places.iter().zip(typical.scales(&places)).map(area).sum();
            assert!((covered / (DEPTH * seen) - 1.0).abs() < 1e-3, "{count}: {covered}");
        }
    }

    /// A third of the side needs fewer Gaussians than whole images; there are never fewer than before.
    #[test]
    fn there_are_as_many_as_the_images_may_have() {
        let device = Device::flex().autodiff();
        let cloud =
            PointCloud { positions: vec![[0.0; 3], [0.1, 0.2, 0.3], [0.0, 0.5, 0.0]], colors: vec![[0.5; 3]; 3] };
        let mut gaussians = GaussiansConfig::new().init(&cloud, &device);
        let mut adam = Adam::default();
        let mut editor = GaussianEditor::new(&mut gaussians, &mut adam);
        let mut typical = typical(&[(Vec3::new(0.0, 0.0, -4.0), 150.0)], 5000.0);
        typical.most = 40;
        let mut counts = Vec::new();
        for iteration in 1..=12 {
            let image_factor = if iteration <= 6 { 3 } else { 1 };
            let position = TrainingPosition { stage: Stage::Fine, iteration, image_factor, extent: 1.0, seed: 0 };
            typical.after_step(&mut editor, &position);
            counts.push(editor.len());
        }
        // 40 by 3 to the power of -1.4, after iteration 4; then all, after iteration 7.
        assert_eq!(counts, [3, 3, 3, 9, 9, 9, 40, 40, 40, 40, 40, 40]);
        let tensors = gaussians.tensors();
        let largest = tensors.log_scales.exp().max().into_scalar::<f32>();
        let pixels = f64::from(largest * 150.0) / 4.5;
        assert!(pixels < (DEPTH * 5000.0 / std::f64::consts::PI / 40.0).sqrt(), "{pixels}");
        assert_eq!(tensors.opacity_logits.abs().max().into_scalar::<f32>(), 0.0);
    }

    #[test]
    fn what_is_beside_a_camera_has_a_size() {
        let scales = typical(&[(Vec3::ZERO, 100.0), (Vec3::X, 100.0)], 100.0).scales(&[Vec3::ZERO, Vec3::X]);
        assert!(scales.iter().all(|scale| scale.is_finite() && *scale > 0.0), "{scales:?}");
    }
}
