//! Guided sampling (after Li et al., CVPR 2024): Gaussians of a short life where a frame is not explained.

use burn::module::Module;
use burn::tensor::{Tensor, TensorData};
use glam::Vec3;
use light4gs_data::{Frame, SH_C0};
use light4gs_model::attributes::Start;
use light4gs_model::{DeformationField, FurtherTensor, GaussianTensors, Moment};
use rand::Rng;

use super::Trainer;
use crate::compression::EntropyModels;
use crate::density::GaussianEditor;
use crate::error::TrainError;
use crate::metrics::{image_tensor, mask_tensor};
use crate::randomness::{Purpose, generator};
use crate::stage::Stage;

/// Smallest sum of squared differences over the channels at which a pixel is not explained: a twentieth in each.
const LEAST_ERROR: f32 = 0.0075;
/// Smallest alpha at which a pixel has a depth.
const LEAST_ALPHA: f32 = 0.1;
/// Depth of a new Gaussian as a share of the rendered depth: it has to cover the surface there.
const SHARE_OF_DEPTH: f32 = 0.97;
/// Standard deviation of a new Gaussian on the screen as a share of the mean distance to the next one; bounds in pixels.
const SHARE_OF_DISTANCE: f32 = 0.6;
const DEVIATIONS: [f32; 2] = [0.7, 4.0];
/// Logit of their opacity.
const OPACITY_LOGIT: f32 = 2.0;

/// A Gaussian to be added: round, of one color.
struct Seed {
    mean: Vec3,
    log_scale: f32,
    /// Red, green, blue in [0, 1].
    color: [f32; 3],
    time: f32,
}

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// Adds Gaussians where frames are not explained after an iteration of the fine stage.
    pub(super) fn sample_guided(&mut self, iteration: usize) -> Result<(), TrainError> {
        let frames = self.one_view_per_time(Purpose::GuidedSampling, iteration);
        let mut random = generator(self.config.seed, Purpose::GuidedSampling, Stage::Fine, iteration);
        let mut seeds = Vec::new();
        for frame in frames {
            self.seeds_of(frame, iteration, random.random(), &mut seeds)?;
        }
        if seeds.is_empty() {
            return Ok(());
        }
        let times = self.candidates.times.len();
        let deviation = self.config.train.guided_sampling.lifetime as f32 / (times.max(2) - 1) as f32;
        let before = self.state.scene.gaussians.len();
        let field = self.state.scene.field.valid();
        let mut editor = GaussianEditor::new(&mut self.state.scene.gaussians, &mut self.state.adam);
        // Copies of any Gaussian, which then get values of their own.
        let rows: Vec<usize> = (0..before).chain(seeds.iter().map(|_| 0)).collect();
        editor.select_rows(&rows, before);
        editor.update(|tensors| {
            with_seeds(tensors, before, &seeds, |seed| Moment { time: seed.time, deviation }, &field)
        });
        // Its statistics have a number for each Gaussian.
        let device = self.device.clone().inner();
        self.density.begin_stage(self.state.scene.gaussians.len(), &device);
        self.profile.lap("guided sampling");
        Ok(())
    }

    /// Seeds at pixels of a frame, drawn in proportion to their squared differences: at equal steps of the running sum. The
    /// first is at `first` in [0, 1) of a step.
    fn seeds_of(&self, index: usize, iteration: usize, first: f32, seeds: &mut Vec<Seed>) -> Result<(), TrainError> {
        let frame: &Frame = &self.data.train[index];
        let seen = self.as_trained(iteration, index);
        // Without a tape, which would keep every view's tensors until the next backward pass.
        let scene = self.state.scene.valid();
        let rendering = self.splatter(Stage::Fine, iteration).render(scene.at(seen.time), &seen.camera, None);
        let device = self.device.clone().inner();
        let mut truth = image_tensor(&*self.images.image(frame)?, &device);
        if let Some(correction) = self.correction(Stage::Fine, iteration, index) {
            truth = correction.radiance(truth);
        }
        let mut errors = (rendering.image - truth.clone()).powi_scalar(2).sum_dim(2).squeeze_dim::<2>(2);
        if let Some(mask) = self.images.trained_pixels(frame)? {
            errors = errors * mask_tensor(&mask, &device);
        }
        let [errors, alpha, depth] = [errors, rendering.alpha, rendering.depth].map(numbers);
        let truth = numbers(truth);
        let error = |pixel: usize| match alpha[pixel] >= LEAST_ALPHA && errors[pixel] >= LEAST_ERROR {
            true => errors[pixel],
            false => 0.0,
        };
        let total: f32 = (0..errors.len()).map(error).sum();
        let area = (0..errors.len()).filter(|pixel| error(*pixel) > 0.0).count();
        let count = self.config.train.guided_sampling.count as f32;
        let [least, most] = DEVIATIONS;
        let deviation = (SHARE_OF_DISTANCE * (area as f32 / count).sqrt()).clamp(least, most);
        let camera = &seen.camera;
        let width = camera.width as usize;
        let (mut sum, mut next) = (0.0, first * total / count);
        for pixel in 0..errors.len() {
            sum += error(pixel);
            if sum <= next {
                continue;
            }
            while next < sum {
                next += total / count;
            }
            let z = SHARE_OF_DEPTH * depth[pixel] / alpha[pixel];
            let [u, v] = [pixel % width, pixel / width].map(|place| place as f32 + 0.5);
            let place = Vec3::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0) * z;
            seeds.push(Seed {
                mean: camera.rotation.transpose() * (place - camera.translation),
                log_scale: (deviation * z / camera.fx).ln(),
                color: std::array::from_fn(|channel| truth[3 * pixel + channel]),
                time: seen.time,
            });
        }
        Ok(())
    }
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter().collect()
}

/// The same with the rows from `before` on replaced by seeds.
fn with_seeds<F: DeformationField>(
    tensors: GaussianTensors,
    before: usize,
    seeds: &[Seed],
    moment: impl Fn(&Seed) -> Moment,
    field: &F,
) -> GaussianTensors {
    let put = |old: Tensor<2>, row: &dyn Fn(&Seed) -> Vec<f32>| {
        let shape = [seeds.len(), old.dims()[1]];
        let rows: Vec<f32> = seeds.iter().flat_map(row).collect();
        let rows = Tensor::from_data(TensorData::new(rows, shape), &old.device());
        Tensor::cat(vec![old.narrow(0, 0, before), rows], 0)
    };
    let [count, coefficients, _] = tensors.sh_rest.dims();
    let sh_dc = put(tensors.sh_dc.reshape([count, 3]), &|seed| seed.color.map(|value| (value - 0.5) / SH_C0).to_vec());
    let further = tensors.further.into_iter().map(|FurtherTensor { attribute, values }| {
        let width = values.dims()[1];
        let usual = || match &attribute.start {
            Start::Row(row) => row.to_vec(),
            _ => vec![0.0; width],
        };
        let values = put(values, &|seed| field.passing(&attribute, &moment(seed)).unwrap_or_else(usual));
        FurtherTensor { attribute, values }
    });
    GaussianTensors {
        means: put(tensors.means, &|seed| seed.mean.to_array().to_vec()),
        log_scales: put(tensors.log_scales, &|seed| vec![seed.log_scale; 3]),
        quats: put(tensors.quats, &|_| vec![1.0, 0.0, 0.0, 0.0]),
        opacity_logits: put(tensors.opacity_logits, &|_| vec![OPACITY_LOGIT]),
        sh_dc: sh_dc.reshape([count, 1, 3]),
        // Those of the Gaussian that was copied are of no use.
        sh_rest: match coefficients {
            0 => tensors.sh_rest,
            _ => put(tensors.sh_rest.reshape([count, 3 * coefficients]), &|_| vec![0.0; 3 * coefficients]).reshape([
                count,
                coefficients,
                3,
            ]),
        },
        further: further.collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use light4gs_data::{Camera, PointCloud, RgbImage8, Scene, SplitFrames};
    use light4gs_model::{LIFETIME, STILLNESS, Splatter};

    use super::*;
    use crate::config::Config;
    use crate::dataset::MemoryImages;

    const SIZE: usize = 32;
    /// Where the third frame is red, columns and rows.
    const SQUARE: std::ops::Range<usize> = 12..18;
    /// Nothing but the sampling changes the scene.
    const KEYS: [&str; 17] = [
        "device=flex",
        "model.nodes.lifetime=true",
        "train.sampling=shuffled",
        "train.coarse_iterations=1",
        "train.fine_iterations=3",
        "train.densify.strategy=none",
        "train.prune.fraction=0",
        "train.guided_sampling.iterations=[2]",
        "train.guided_sampling.count=20",
        "train.learning_rate.attributes_init={ means = 1e-12, log_scales = 1e-12, quats = 1e-12, opacity_logits = 1e-12 }",
        "train.learning_rate.attributes_init={ sh_dc = 1e-12, sh_rest = 1e-12 }",
        "train.learning_rate.attributes_final.means=1e-12",
        "train.learning_rate.deformation_init=1e-12",
        "train.learning_rate.deformation_final=1e-12",
        "compression.rate.attributes=false",
        "compression.rate.lambda=0",
        "eval.interval=0",
    ];

    fn config(keys: &[&str]) -> Result<Config, crate::config::ConfigError> {
        Config::load("dnerf", &keys.iter().map(|key| (*key).to_owned()).collect::<Vec<_>>())
    }

    fn trainer(images: MemoryImages) -> Trainer {
        let camera = Camera::look_at(
            [3.0, 0.0, 0.5].into(),
            [0.0; 3].into(),
            [0.0, 0.0, 1.0].into(),
            0.5,
            SIZE as u32,
            SIZE as u32,
        );
        let frames: Vec<Frame> = (0..4).map(|k| Frame::without_image(format!("{k}"), camera, k as f32 / 3.0)).collect();
        let frames = SplitFrames { test: frames.clone(), train: frames, ..SplitFrames::default() };
        let data = Scene::new("memory", Path::new("cloud"), frames, PointCloud::random(200, 0.8, 0), [1.0; 3]).unwrap();
        Trainer::builder(config(&KEYS).unwrap(), data).images(images).build().unwrap()
    }

    /// The image of the scene at a time, `[SIZE, SIZE, 3]`.
    fn seen(trainer: &Trainer, time: f32) -> Vec<f32> {
        let scene = trainer.scene().valid();
        let camera = &trainer.data().train[0].camera;
        numbers(Splatter::new([1.0; 3], 0).render(scene.at(time), camera, None).image)
    }

    fn in_square(pixel: usize) -> bool {
        SQUARE.contains(&(pixel % SIZE)) && SQUARE.contains(&(pixel / SIZE))
    }

    /// All frames show the scene as it is at the beginning, but for a red square in the third one.
    #[test]
    fn what_is_there_in_one_frame_only_gets_gaussians_of_its_own() {
        let before = seen(&trainer(MemoryImages::default()), 0.0);
        let bytes: Vec<u8> = before.iter().map(|value| (value * 255.0).round() as u8).collect();
        let image = |red: bool| {
            let mut pixels = bytes.clone();
            let square = pixels.chunks_exact_mut(3).enumerate().filter(|(pixel, _)| red && in_square(*pixel));
            square.for_each(|(_, color)| color.copy_from_slice(&[255, 0, 0]));
            RgbImage8 { width: SIZE as u32, height: SIZE as u32, pixels }
        };
        let mut trainer = trainer((0..4).map(|k| (format!("{k}"), image(k == 2))).collect());
        while trainer.step().unwrap().is_some() {}

        let added = trainer.scene().gaussians.tensors().rows(200..trainer.scene().gaussians.len());
        let count = added.means.dims()[0];
        assert!((10..=20).contains(&count), "{count}");
        let camera = &trainer.data().train[0].camera;
        for mean in numbers(added.means.clone()).as_chunks::<3>().0 {
            let (u, v, _) = camera.project(Vec3::from_array(*mean));
            assert!(in_square(v.round() as usize * SIZE + u.round() as usize), "{u} {v}");
        }
        let moments = numbers(added.further(LIFETIME).unwrap().clone());
        assert!(moments.as_chunks::<2>().0.iter().all(|[time, _]| (time - 2.0 / 3.0).abs() < 1e-5), "{moments:?}");
        assert!(numbers(added.further(STILLNESS).unwrap().clone()).iter().all(|logit| *logit > 5.0));

        let off = |time: f32| {
            let now = seen(&trainer, time);
            let square = (0..SIZE * SIZE).filter(|pixel| in_square(*pixel));
            let off = square.map(|pixel| (now[3 * pixel] - 1.0).abs() + now[3 * pixel + 1] + now[3 * pixel + 2]);
            off.sum::<f32>() / SQUARE.len().pow(2) as f32
        };
        assert!(off(2.0 / 3.0) < 0.5 * off(0.0), "{} {}", off(2.0 / 3.0), off(0.0));
        let changed = seen(&trainer, 0.0).iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(changed < 0.02, "another frame changes by {changed}");
    }

    #[test]
    fn without_lifetimes_it_is_refused() {
        let keys = ["train.guided_sampling.iterations=[5]"];
        let message = config(&keys).unwrap_err().to_string();
        assert!(
            message.contains("train.guided_sampling.iterations") && message.contains("model.nodes.lifetime"),
            "{message}"
        );
        let late = config(&["model.nodes.lifetime=true", "train.guided_sampling.iterations=[50000]"]);
        assert!(late.unwrap_err().to_string().contains("50000"));
    }
}
