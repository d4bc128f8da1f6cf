//! The views of a training step. Each has its own tape, so that they can be rendered and differentiated side by side.

use std::sync::{Arc, Mutex, PoisonError};

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor};
use light4gs_data::{Frame, PixelMask, RgbImage8};
use light4gs_model::parameters::on_a_new_tape;
use light4gs_model::{DeformationField, DynamicScene, Splatter};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::Trainer;
use super::profile::Profile;
use crate::compression::EntropyModels;
use crate::config::CoarseToFineConfig;
use crate::corrections::ViewCorrection;
use crate::dataset::ImageSource;
use crate::density::ViewStatistics;
use crate::error::TrainError;
use crate::loss::{Loss, LossInput};
use crate::metrics::{image_tensor, mask_tensor};
use crate::optimization::gradients::GradientSums;
use crate::stage::Stage;

/// Data that the views of a step share.
pub(super) struct ViewPass<'a> {
    pub(super) stage: Stage,
    pub(super) iteration: usize,
    pub(super) splatter: Splatter,
    pub(super) images: &'a dyn ImageSource,
    pub(super) device: &'a Device,
    pub(super) loss: &'a dyn Loss,
    pub(super) coarse_to_fine: &'a CoarseToFineConfig,
    /// The share of the fine stage that is over.
    pub(super) progress: f64,
    /// Views of an iteration. The loss is their mean.
    pub(super) batch: usize,
    pub(super) offsets: &'a NoOffsets,
}

/// Screen offsets of zero, of which only the gradients are wanted. They are kept, since on a GPU zeros are a launch.
#[derive(Default)]
pub(super) struct NoOffsets(Mutex<Option<Tensor<2>>>);

impl NoOffsets {
    /// `[N, 2]`, a leaf of a new tape.
    fn of(&self, count: usize, device: &Device) -> Tensor<2> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let zeros = kept.take().filter(|zeros| zeros.dims()[0] == count);
        let zeros = zeros.unwrap_or_else(|| Tensor::zeros([count, 2], &device.clone().inner()));
        *kept = Some(zeros.clone());
        Tensor::from_inner(zeros).require_grad()
    }
}

/// The results of a view in a step. No tensor is on a tape.
pub(super) struct View {
    /// Numbers whose sum is its weighted part of the loss.
    pub(super) loss: Tensor<1>,
    /// Gradients of that part of the loss with respect to the scene's parameters.
    pub(super) gradients: GradientSums,
    /// Statistics of the Gaussians.
    pub(super) statistics: ViewStatistics,
    /// `[H, W, 3]`
    pub(super) image: Tensor<3>,
    /// `[H, W, 3]`
    pub(super) truth: Tensor<3>,
    /// `[13]`: the gradient of the view's corrections, where any are learned.
    pub(super) corrections: Option<Tensor<1>>,
    /// `[1]`: see [`Rendering::intersections`](light4gs_model::Rendering::intersections).
    pub(super) intersections: Tensor<1, Int>,
}

/// The processor's threads, divided among the views of a step: a pool for each view that runs beside others.
///
/// With one pool for all, views would wait for each other at every small parallel loop, and a worker that waits inside
/// one view would meanwhile begin another.
pub(super) struct ViewPools(Vec<ThreadPool>);

impl ViewPools {
    /// Pools for `views` views of a step, which together have all threads.
    pub(super) fn new(views: usize) -> Self {
        let threads = rayon::current_num_threads();
        let share = views.div_ceil(threads).max(1);
        let pools = views.div_ceil(share);
        let pool = |i| ThreadPoolBuilder::new().num_threads((threads + i) / pools).build();
        // One pool would be the same as the global one.
        let pools = if pools > 1 { (0..pools).map(pool).collect() } else { Ok(Vec::new()) };
        Self(pools.expect("threads can be started"))
    }

    /// No pools: one view after the other.
    pub(super) fn none() -> Self {
        Self(Vec::new())
    }
}

impl<F: DeformationField, E: EntropyModels> Trainer<F, E> {
    /// A pass over views of an iteration whose loss is the mean of `batch` views.
    pub(super) fn view_pass(&self, stage: Stage, iteration: usize, batch: usize) -> ViewPass<'_> {
        ViewPass {
            stage,
            iteration,
            splatter: self.splatter(stage, iteration),
            images: &*self.images,
            device: &self.device,
            loss: &*self.loss,
            coarse_to_fine: &self.config.train.coarse_to_fine,
            progress: self.config.train.progress(stage, iteration),
            batch,
            offsets: &self.offsets,
        }
    }
}

/// A frame and what has been learned about its camera.
type CorrectedFrame<'f> = (&'f Frame, Option<ViewCorrection>);

impl ViewPass<'_> {
    /// Renders and differentiates every frame, and meanwhile does what needs no view. The results, in the order of the
    /// frames, do not depend on the pools.
    pub(super) fn run<'f, F: DeformationField, R>(
        &self,
        scene: &DynamicScene<F>,
        frames: &[CorrectedFrame<'f>],
        pools: &ViewPools,
        profile: &Profile,
        meanwhile: impl FnOnce() -> R,
    ) -> Result<(Vec<View>, R), TrainError> {
        // Copies share the scene's memory; each begins its own tape.
        let with_copies = |frames: &[CorrectedFrame<'f>]| -> Vec<_> {
            frames.iter().map(|frame| (on_a_new_tape(scene.clone()), *frame)).collect()
        };
        let ViewPools(pools) = pools;
        if pools.is_empty() {
            // First the views: on a GPU these are launched while a thread reads what the rate needs.
            let views = self.views(with_copies(frames), profile)?;
            return Ok((views, meanwhile()));
        }
        std::thread::scope(|scope| {
            let shares = frames.chunks(frames.len().div_ceil(pools.len())).map(with_copies);
            let workers: Vec<_> = shares
                .zip(pools)
                .map(|(share, pool)| scope.spawn(move || pool.install(|| self.views(share, &Profile::off()))))
                .collect();
            let other = meanwhile();
            let mut views = Vec::with_capacity(frames.len());
            for worker in workers {
                views.extend(worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
            }
            Ok((views, other))
        })
    }

    fn views<F: DeformationField>(
        &self,
        tasks: Vec<(DynamicScene<F>, CorrectedFrame<'_>)>,
        profile: &Profile,
    ) -> Result<Vec<View>, TrainError> {
        tasks.into_iter().map(|(scene, (frame, correction))| self.view(scene, frame, correction, profile)).collect()
    }

    fn view<F: DeformationField>(
        &self,
        scene: DynamicScene<F>,
        frame: &Frame,
        correction: Option<ViewCorrection>,
        profile: &Profile,
    ) -> Result<View, TrainError> {
        let learned = correction.map(|correction| correction.on_tape(self.device));
        let mut seen = correction.map_or_else(|| frame.clone(), |correction| correction.frame(frame));
        let mut gaussians = match self.stage {
            Stage::Coarse => scene.gaussians.tensors(),
            Stage::Fine => scene.at(seen.time),
        };
        if let Some(learned) = &learned {
            if self.stage == Stage::Fine {
                gaussians = learned.at_time(gaussians, seen.time, |time| scene.valid().at(time));
            }
            gaussians = learned.turned(gaussians, &frame.camera, &seen.camera);
        }
        profile.lap("Gaussians at the time");
        let factor = self.coarse_to_fine.factor(self.progress, &frame.camera);
        seen.camera = seen.camera.reduced(factor);
        let offsets = self.offsets.of(scene.gaussians.len(), self.device);
        let rendering = self.splatter.render(gaussians, &seen.camera, Some(offsets.clone()));
        profile.lap("splatting");
        let mut truth = image_tensor(&reduced(self.images.image(frame)?, factor, RgbImage8::reduced), self.device);
        let mut image = match &learned {
            Some(learned) => learned.exposed(rendering.image, rendering.alpha.clone()),
            None => rendering.image,
        };
        if let Some(mask) = self.images.trained_pixels(frame)? {
            // Black in both images, so that these pixels are equal for any loss.
            let mask = mask_tensor(&reduced(mask, factor, PixelMask::reduced), self.device).unsqueeze_dim::<3>(2);
            image = image * mask.clone();
            truth = truth * mask;
        }
        profile.lap("training image");
        let loss = self.loss.loss(LossInput {
            image: image.clone(),
            alpha: rendering.alpha,
            depth: rendering.depth,
            truth: truth.clone(),
            frame: &seen,
            stage: self.stage,
            iteration: self.iteration,
        });
        // The loss of a step is the mean over its views. One view needs no launch for it.
        let loss = if self.batch > 1 { loss * (1.0 / self.batch as f32) } else { loss };
        profile.lap("loss");
        let value = loss.clone().inner();
        let mut tape = loss.backward();
        let mut gradients = GradientSums::default();
        gradients.add_module(&scene, &mut tape);
        profile.lap("backward");
        Ok(View {
            loss: value,
            gradients,
            corrections: learned.and_then(|learned| learned.gradient(&mut tape)),
            // The loss is a mean over the batch; thresholds are those for a single view.
            statistics: ViewStatistics {
                screen_gradient: offsets.grad_remove(&mut tape).map(|gradient| match self.batch {
                    1 => gradient,
                    batch => gradient * batch as f32,
                }),
                radii: if factor == 1 { rendering.radii } else { rendering.radii * i64::from(factor) },
            },
            image: image.inner(),
            truth: truth.inner(),
            intersections: rendering.intersections,
        })
    }
}

/// An image or a mask for a training step; whole ones are not copied.
fn reduced<T>(whole: Arc<T>, factor: u32, reduce: fn(&T, u32) -> T) -> Arc<T> {
    if factor == 1 { whole } else { Arc::new(reduce(&whole, factor)) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use light4gs_data::{Camera, PointCloud, Scene, SplitFrames};

    use super::*;
    use crate::config::{Config, DeviceName};
    use crate::dataset::MemoryImages;

    /// Small images and few Gaussians until half of the fine stage is over.
    #[test]
    fn training_goes_from_coarse_to_fine() {
        const SIDE: u32 = 401;
        let mut config = Config::from_preset("hexplane-dnerf-cpu").unwrap();
        config.device = DeviceName::Flex;
        (config.train.coarse_iterations, config.train.fine_iterations) = (1, 4);
        config.train.coarse_to_fine.half_until = 0.5;
        config.train.prune.fraction = 0.0;
        config.eval.interval = 0;
        let adaptive = &mut config.train.densify.strategies.adaptive;
        (adaptive.from, adaptive.until, adaptive.interval, adaptive.max_gaussians) = (0, 4, 1, 100);
        (adaptive.prune_from, adaptive.grad_threshold_fine_init, adaptive.grad_threshold_fine_final) =
            (9, 1e-30, 1e-30);
        let camera = Camera::look_at([4.0, 0.0, 0.5].into(), [0.0; 3].into(), [0.0, 0.0, 1.0].into(), 0.7, SIDE, SIDE);
        let frame = Frame::without_image("view", camera, 0.5);
        let image = RgbImage8 { width: SIDE, height: SIDE, pixels: vec![100; (SIDE * SIDE * 3) as usize] };
        let images: MemoryImages = [(frame.name.clone(), image)].into_iter().collect();
        let frames = SplitFrames { train: vec![frame.clone()], test: vec![frame], ..SplitFrames::default() };
        let data = Scene::new("memory", Path::new("gray"), frames, PointCloud::random(60, 0.8, 0), [1.0; 3]).unwrap();
        let mut trainer = Trainer::builder(config, data).images(images).build().unwrap();
        let mut steps = Vec::new();
        while let Some(report) = trainer.step().unwrap() {
            assert_eq!(report.image.dims(), report.truth.dims());
            steps.push((report.image.dims()[0], report.gaussians > 60));
        }
        // One row and one column are left over.
        assert_eq!(steps, [(200, false), (200, false), (200, false), (401, true), (401, true)]);
    }

    #[test]
    fn pools_have_all_threads_and_no_more() {
        for (threads, views, pools) in [(1, 4, 0), (2, 1, 0), (2, 4, 2), (3, 4, 2), (6, 4, 4), (16, 3, 3)] {
            let outer = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let ViewPools(made) = outer.install(|| ViewPools::new(views));
            assert_eq!(made.len(), pools, "{threads} threads, {views} views");
            let sum: usize = made.iter().map(ThreadPool::current_num_threads).sum();
            assert!(made.is_empty() || sum == threads, "{sum} of {threads} threads");
        }
    }
}
